#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/geometry/random_geometry.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"
#include "with_threads.h"

namespace usct {
namespace {

using test::integer;
using test::random_grid;
using test::random_motorised;
using test::random_pose;
using test::uneven_table;
using test::uniform;

/// A probe like the 4DC7-3/40 with a slow half of the sweep and a motor that does not stop.
ScanGeometry uneven_probe() {
  ScanGeometry geometry;
  geometry.axial = {160, 2.0, 0.5};
  geometry.array = CurvilinearArray{40.0, centred_table(96, 0.68 * kDegree)};
  MotorSweep sweep{27.25, {}, -0.3 * kDegree};
  for (int frame = -40; frame <= 40; ++frame)
    sweep.frame_angles_rad.push_back(frame * (frame < 0 ? 0.611 : 0.747) * kDegree);
  geometry.motion = sweep;
  return geometry;
}

/// Thesis eqs 4.11-4.14 as printed, for whole indices.
Eigen::Vector3d printed_position(const ScanGeometry& geometry, int sample, int line, int frame) {
  const auto& array = std::get<CurvilinearArray>(geometry.array);
  const auto& sweep = std::get<MotorSweep>(geometry.motion);
  const double D = array.probe_radius_mm - sweep.motor_radius_mm;
  const double h =
      array.probe_radius_mm + geometry.axial.start_depth_mm + sample * geometry.axial.spacing_mm;
  const double theta = array.line_angles_rad[static_cast<std::size_t>(line)];
  const double phi =
      sweep.frame_angles_rad[static_cast<std::size_t>(frame)] +
      sweep.frame_travel_rad * (line - 0.5 * (geometry.lines() - 1)) / geometry.lines();
  const double H = h * std::cos(theta);
  return {H * std::tan(theta), (H - D) * std::cos(phi) + D, (H - D) * std::sin(phi)};
}

/// A smooth pattern in space; second derivatives are below 100 / (12 mm)^2 per axis.
double pattern(const Eigen::Vector3d& p) {
  return 128.0 + 40.0 * std::sin(p.x() / 12.0) + 30.0 * std::cos(p.y() / 12.0) +
         30.0 * std::sin(p.z() / 12.0 + 1.0);
}

/// The pattern as the probe would record it.
PreScanVolume record_pattern(const ScanGeometry& geometry) {
  PreScanVolume prescan{geometry, {}, {}};
  for (int frame = 0; frame < geometry.frames(); ++frame)
    for (int line = 0; line < geometry.lines(); ++line)
      for (int sample = 0; sample < geometry.samples(); ++sample)
        prescan.voxels.push_back(static_cast<std::uint8_t>(
            std::lround(pattern(printed_position(geometry, sample, line, frame)))));
  return prescan;
}

// The converted volume has each value of the recorded pattern at its position, on any grid.
TEST(ScanConvert, PutsEveryStructureWhereThePrintedEquationsSayItWas) {
  const ScanGeometry geometry = uneven_probe();
  const PreScanVolume prescan = record_pattern(geometry);
  Grid oblique = fan_grid(geometry, 2.5);
  oblique.direction = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, -1).normalized()).matrix();
  oblique.direction.col(1) *= -1.0;
  oblique.origin_mm =
      Eigen::Vector3d(0, 80, 0) -
      oblique.direction * oblique.spacing_mm.cwiseProduct(0.5 * oblique.size.cast<double>());
  for (const Grid& grid : {fan_grid(geometry, 1.5), oblique}) {
    const ScanConverted result = scan_convert(prescan, grid, Interpolation::kTrilinear);
    std::size_t known = 0;
    for (int k = 0; k < grid.size.z(); ++k)
      for (int j = 0; j < grid.size.y(); ++j)
        for (int i = 0; i < grid.size.x(); ++i) {
          if (result.mask.at(i, j, k) == 0) {
            EXPECT_EQ(result.volume.at(i, j, k), 0);
            continue;
          }
          ++known;
          // Rounding twice, interpolation over at most 1.7 mm (deepest lines and frames: a quarter
          // of that squared times half the second derivative), the repeated edge: half a step.
          EXPECT_NEAR(result.volume.at(i, j, k),
                      pattern(grid.physical_from_index(Eigen::Vector3d(i, j, k))), 5.0);
        }
    EXPECT_GT(known, grid.voxel_count() / 10);
  }
}

// The mask is the acquired region: it holds all samples, and no point more than half a step
// outside.
RC_GTEST_PROP(ScanConvert, MaskIsTheAcquiredFan, ()) {
  ScanGeometry geometry = random_motorised();
  const PreScanVolume prescan{
      geometry,
      std::vector<std::uint8_t>(static_cast<std::size_t>(geometry.samples()) *
                                    static_cast<std::size_t>(geometry.lines()) *
                                    static_cast<std::size_t>(geometry.frames()),
                                200),
      {}};
  for (int n = 0; n < 20; ++n) {
    const auto around = [&](int count) { return uniform(-2.0, count + 1.0); };
    const ScanIndex index{around(geometry.samples()), around(geometry.lines()),
                          around(geometry.frames())};
    const auto inside = [](double i, int count, double margin) {
      return i > -0.5 + margin && i < count - 0.5 - margin;
    };
    const auto all_inside = [&](double margin) {
      return inside(index.sample, geometry.samples(), margin) &&
             inside(index.line, geometry.lines(), margin) &&
             inside(index.frame, geometry.frames(), margin);
    };
    // One voxel at the point, as a grid along the axes and as an oblique one.
    Grid grid;
    grid.size = {1, 1, 1};
    grid.origin_mm = us_from_scan(geometry, index);
    const auto& sweep = std::get<MotorSweep>(geometry.motion);
    const auto& array = std::get<CurvilinearArray>(geometry.array);
    const double axis_y = array.probe_radius_mm - sweep.motor_radius_mm;
    const Line line = line_in_frame(geometry.array, index.line);
    const Eigen::Vector3d in_frame =
        line.origin_mm + geometry.axial.depth_mm(index.sample) * line.direction;
    // Behind the motor axis, or half a turn beyond the sweep, a point has another index as well.
    const double theta = interpolate_table(array.line_angles_rad, index.line);
    const double phi = motor_angle_rad(sweep, geometry.lines(), index.frame, index.line);
    if (in_frame.y() <= axis_y + 1e-3 || std::abs(theta) > 3.1 || std::abs(phi) > 3.1) continue;
    RC_LOG() << "height over the motor axis " << in_frame.y() - axis_y << " mm, index "
             << index.sample << " " << index.line << " " << index.frame << " theta " << theta
             << " phi " << phi << "\n";
    for (const bool oblique : {false, true}) {
      if (oblique) grid.direction = test::random_rotation();
      const ScanConverted result = scan_convert(prescan, grid, Interpolation::kNearest);
      if (all_inside(1e-6)) RC_ASSERT(result.mask.voxels[0] == 255);
      if (!all_inside(-1e-6)) RC_ASSERT(result.mask.voxels[0] == 0);
      RC_ASSERT(result.volume.voxels[0] == (result.mask.voxels[0] ? 200 : 0));
    }
  }
}

RC_GTEST_PROP(ScanConvert, AVoxelOnASampleTakesItsValue, ()) {
  ScanGeometry geometry = random_motorised();
  geometry.axial.samples = 2 + geometry.axial.samples % 60;
  PreScanVolume prescan{geometry, {}, {}};
  prescan.voxels.resize(static_cast<std::size_t>(geometry.samples()) *
                        static_cast<std::size_t>(geometry.lines()) *
                        static_cast<std::size_t>(geometry.frames()));
  const int sample = integer(0, geometry.samples());
  const int line = integer(0, geometry.lines());
  const int frame = integer(0, geometry.frames());
  const auto value = static_cast<std::uint8_t>(integer(1, 256));
  prescan.voxels[prescan.offset(sample, line, frame)] = value;
  Grid grid;
  grid.size = {1, 1, 1};
  grid.origin_mm = printed_position(geometry, sample, line, frame);
  for (const auto interpolation : {Interpolation::kNearest, Interpolation::kTrilinear})
    RC_ASSERT(scan_convert(prescan, grid, interpolation).volume.voxels[0] == value);
}

TEST(ScanConvert, FanGridCoversAllThatIsAcquiredAndLittleMore) {
  const ScanGeometry geometry = uneven_probe();
  const Grid grid = fan_grid(geometry, 1.0);
  PreScanVolume prescan = record_pattern(geometry);
  const ScanConverted result = scan_convert(prescan, grid, Interpolation::kNearest);
  // The fan comes within two voxels of every face of the grid and is not cut off: a grid that is
  // larger by 10 voxels on each side has the same known voxels.
  Grid larger = grid;
  larger.size.array() += 20;
  larger.origin_mm.array() -= 10.0;
  const ScanConverted reference = scan_convert(prescan, larger, Interpolation::kNearest);
  Eigen::AlignedBox3i box;
  for (int k = 0; k < larger.size.z(); ++k)
    for (int j = 0; j < larger.size.y(); ++j)
      for (int i = 0; i < larger.size.x(); ++i)
        if (reference.mask.at(i, j, k) != 0) box.extend(Eigen::Vector3i(i - 10, j - 10, k - 10));
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GE(box.min()[axis], 0);
    EXPECT_LE(box.min()[axis], 1);
    EXPECT_LE(box.max()[axis], grid.size[axis] - 1);
    EXPECT_GE(box.max()[axis], grid.size[axis] - 2);
  }
  EXPECT_EQ(std::count(result.mask.voxels.begin(), result.mask.voxels.end(), 255),
            std::count(reference.mask.voxels.begin(), reference.mask.voxels.end(), 255));
}

TEST(ScanConvert, IsTheSameForAnyNumberOfThreadsAndReportsProgress) {
  const ScanGeometry geometry = uneven_probe();
  const PreScanVolume prescan = record_pattern(geometry);
  const Grid grid = fan_grid(geometry, 2.0);
  double last = 0.0;
  const auto converted = [&] {
    return scan_convert(prescan, grid, Interpolation::kTrilinear,
                        [&](double fraction) { last = fraction; });
  };
  const ScanConverted one = test::with_threads(1, converted);
  const ScanConverted four = test::with_threads(4, converted);
  EXPECT_EQ(one.volume.voxels, four.volume.voxels);
  EXPECT_EQ(one.mask.voxels, four.mask.voxels);
  EXPECT_EQ(last, 1.0);
}

TEST(ScanConvert, RefusesTrackedSweepsAndInvalidGrids) {
  PreScanVolume prescan = record_pattern(uneven_probe());
  Grid grid;
  EXPECT_THROW(scan_convert(prescan, grid, Interpolation::kNearest), InputError);  // size 0
  grid.size = {1, 1, 1};
  EXPECT_NO_THROW(scan_convert(prescan, grid, Interpolation::kNearest));
  prescan.geometry.motion =
      TrackedSweep{std::vector<Eigen::Isometry3d>(81, Eigen::Isometry3d::Identity()), {}};
  EXPECT_THROW(scan_convert(prescan, grid, Interpolation::kNearest), InputError);
  EXPECT_THROW(fan_grid(uneven_probe(), 0.0), InputError);
}

/// A volume whose voxels are an affine function of physical position: interpolation is exact.
Volume<float> affine_volume(const Grid& grid, const Eigen::Vector3d& gradient, double constant) {
  Volume<float> volume(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        volume.at(i, j, k) = static_cast<float>(
            constant + gradient.dot(grid.physical_from_index(Eigen::Vector3d(i, j, k))));
  return volume;
}

// The CT is sampled at the positions of the beams, with the pose applied in the right direction.
RC_GTEST_PROP(SampleAlongBeams, ReadsTheVolumeAtTheBeamsPosition, ()) {
  const Grid grid = random_grid(30);
  const Eigen::Vector3d gradient(uniform(-3, 3), uniform(-3, 3), uniform(-3, 3));
  const double constant = uniform(-100, 100);
  const Volume<float> volume = affine_volume(grid, gradient, constant);
  BeamGrid beams;
  beams.axial = {integer(2, 20), uniform(0.0, 5.0), uniform(0.05, 1.0)};
  beams.lines = 3;
  beams.frames = 2;
  // Beams start anywhere in the volume; some leave it.
  const Eigen::Isometry3d T_volume_us = random_pose();
  for (int n = 0; n < 6; ++n) {
    const Eigen::Vector3d index = grid.size.cast<double>().cwiseProduct(
        Eigen::Vector3d(uniform(0, 1), uniform(0, 1), uniform(0, 1)));
    beams.beams.push_back(
        {T_volume_us.inverse() * grid.physical_from_index(index), test::random_rotation().col(0)});
  }
  const std::vector<float> values = sample_along_beams(
      volume, beams, T_volume_us, Interpolation::kTrilinear, Outside::constant(-12345.0F));
  RC_ASSERT(values.size() == static_cast<std::size_t>(6 * beams.samples()));
  std::size_t n = 0;
  for (int frame = 0; frame < 2; ++frame)
    for (int line = 0; line < 3; ++line)
      for (int sample = 0; sample < beams.samples(); ++sample, ++n) {
        const Beam& beam = beams.beams[static_cast<std::size_t>(3 * frame + line)];
        const Eigen::Vector3d p =
            T_volume_us *
            (beam.origin_mm +
             (beams.axial.start_depth_mm + sample * beams.axial.spacing_mm) * beam.direction);
        const Eigen::Vector3d index = grid.index_from_physical(p);
        const Eigen::Vector3d last = grid.size.cast<double>() - Eigen::Vector3d::Ones();
        if ((index.array() > 1e-6).all() && (index.array() < last.array() - 1e-6).all())
          RC_ASSERT(std::abs(values[n] - (constant + gradient.dot(p))) < 0.01);
        if ((index.array() < -0.501).any() || (index.array() > last.array() + 0.501).any())
          RC_ASSERT(values[n] == -12345.0F);
      }
}

// A volume sampled along the beams and then scan-converted equals the volume.
TEST(SampleAlongBeams, ScanConversionUndoesIt) {
  const ScanGeometry geometry = uneven_probe();
  const Grid grid = fan_grid(geometry, 2.0);
  Volume<std::uint8_t> volume(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        volume.at(i, j, k) = static_cast<std::uint8_t>(
            pattern(grid.physical_from_index(Eigen::Vector3d(i, j, k))) + 0.5);
  const std::vector<float> along =
      sample_along_beams(volume, beam_grid(geometry), Eigen::Isometry3d::Identity(),
                         Interpolation::kTrilinear, Outside::edge());
  PreScanVolume prescan{geometry, {}, {}};
  for (const float value : along) prescan.voxels.push_back(static_cast<std::uint8_t>(value + 0.5F));
  const ScanConverted back = scan_convert(prescan, grid, Interpolation::kTrilinear);
  for (std::size_t n = 0; n < back.mask.voxels.size(); ++n)
    if (back.mask.voxels[n] != 0) {
      EXPECT_NEAR(back.volume.voxels[n], volume.voxels[n], 6);
    }
}

}  // namespace
}  // namespace usct
