#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <iostream>
#include <sstream>

#include "test_data.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/ultrasound/compounding.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"

/// Independent oracles: images and volumes that a scanner and the Plus toolkit made from the same
/// recordings. Set USCT_TEST_PICTURES to a folder to look at them.
namespace usct {
namespace {

/// Plus and scanners take the value at the pixel's centre.
const CompoundOptions kPointSamples{Compounding::kMean, 1.0, false, 0.0};

std::filesystem::path plus_file(const std::string& name) {
  return test::data_root() / "plus_us" / name;
}

/// One picture, or part of a volume, with a mask of known pixels.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
  std::vector<std::uint8_t> mask;
};

void save(const std::string& name, const std::vector<Picture>& side_by_side) {
  const char* folder = std::getenv("USCT_TEST_PICTURES");
  if (folder == nullptr) return;
  std::ofstream out(std::filesystem::path(folder) / (name + ".pgm"), std::ios::binary);
  const Picture& first = side_by_side.front();
  out << "P5 " << first.width * static_cast<int>(side_by_side.size()) << " " << first.height
      << " 255\n";
  for (int row = 0; row < first.height; ++row)
    for (const Picture& picture : side_by_side)
      out.write(reinterpret_cast<const char*>(picture.pixels.data()) +
                    static_cast<std::ptrdiff_t>(row) * first.width,
                first.width);
}

/// Agreement of two pictures within `mask`.
struct Agreement {
  double correlation = 0.0;
  /// Correlation of b with the function of a that explains it best: 1 if one grey value of a always
  /// has the same grey value in b. It ignores the grey maps of two machines, which may differ, and
  /// shows differences of geometry.
  double correlation_ratio = 0.0;
  double mean_absolute_difference = 0.0;
  int largest_difference = 0;
  std::size_t pixels = 0;
};

Agreement agreement(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b,
                    const std::vector<std::uint8_t>& mask) {
  std::array<double, 256> count{};
  std::array<double, 256> sum{};
  double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0, difference = 0;
  Agreement result;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (mask[i] == 0) continue;
    const double x = a[i];
    const double y = b[i];
    n += 1, sa += x, sb += y, saa += x * x, sbb += y * y, sab += x * y;
    count[a[i]] += 1;
    sum[a[i]] += y;
    difference += std::abs(x - y);
    result.largest_difference = std::max(result.largest_difference, std::abs(a[i] - b[i]));
  }
  const double variance_a = saa / n - sa / n * sa / n;
  const double variance_b = sbb / n - sb / n * sb / n;
  double explained = 0.0;
  for (std::size_t v = 0; v < 256; ++v)
    if (count[v] > 0) explained += sum[v] * sum[v] / count[v];
  result.correlation = (sab / n - sa / n * sb / n) / std::sqrt(variance_a * variance_b);
  result.correlation_ratio = std::sqrt((explained / n - sb / n * sb / n) / variance_b);
  result.mean_absolute_difference = difference / n;
  result.pixels = static_cast<std::size_t>(n);
  return result;
}

/// The Ultrasonix BPC8-4/10 as PlusDeviceSet_RfProcessingAlgoCurvilinearTest.xml describes it, or
/// as a scanner's picture shows it. The end of the last sample, and not its centre, is at the stop
/// radius; the origin of a picture is the middle of the array's surface.
struct Fan {
  double start_radius_mm = 10.0;
  double stop_radius_mm = 82.0;
  double half_angle_deg = 75.0;
  Eigen::Vector2d origin_px{409.5, 87.0};

  ScanGeometry geometry(int samples, int lines) const {
    ScanGeometry geometry;
    geometry.axial = {samples, 0.0, (stop_radius_mm - start_radius_mm) / samples};
    geometry.array = CurvilinearArray{
        start_radius_mm, centred_table(lines, 2.0 * half_angle_deg * kDegree / (lines - 1))};
    geometry.motion = TrackedSweep{{Eigen::Isometry3d::Identity()}, {}};
    return geometry;
  }
  /// The picture of 820 x 616 pixels at 0.15 mm, moved by a part of a pixel.
  Grid picture(const Eigen::Vector2d& shift_px = {0.0, 0.0}) const {
    Grid grid;
    grid.size = {820, 616, 1};
    grid.spacing_mm.setConstant(0.15);
    grid.origin_mm = {-0.15 * (origin_px.x() + shift_px.x()),
                      start_radius_mm - 0.15 * (origin_px.y() + shift_px.y()), 0.0};
    return grid;
  }
};

/// One brightness frame, samples contiguous.
PreScanVolume brightness_frame(const IgsioSequence& sequence, int frame, const Fan& fan) {
  OrientedImage image = oriented_frame(sequence, frame, "FM", "brightness");
  return {fan.geometry(image.width, image.height), std::move(image.pixels), {}};
}

/// The same frame twice in a motorised sweep: half way between them is the plane z = 0.
PreScanVolume as_motorised(PreScanVolume prescan) {
  const std::vector<std::uint8_t> once = prescan.voxels;
  prescan.voxels.insert(prescan.voxels.end(), once.begin(), once.end());
  prescan.geometry.motion = MotorSweep{9.0, {-0.01, 0.01}, 0.0};
  return prescan;
}

Picture picture_of(const ScanConverted& converted) {
  const Eigen::Vector3i& size = converted.volume.grid.size;
  return {size.x(), size.y(), converted.volume.voxels, converted.mask.voxels};
}

Picture picture_of(const IgsioSequence& sequence, int frame) {
  const OrientedImage image = oriented_frame(sequence, frame, "MF", "picture");
  return {image.width, image.height, image.pixels, {}};
}

Picture mirrored(Picture picture) {
  for (int row = 0; row < picture.height; ++row) {
    const auto begin = picture.pixels.begin() + static_cast<std::ptrdiff_t>(row) * picture.width;
    std::reverse(begin, begin + picture.width);
  }
  return picture;
}

/// The shift along one axis with the best agreement: vertex of the parabola through three values.
double vertex(double before, double here, double after, double step) {
  return 0.5 * step * (before - after) / (before - 2.0 * here + after);
}

/// Sub-pixel shift of `reference` against our conversion of `prescan`, in pixels, by correlation
/// ratio.
Eigen::Vector2d best_shift(const PreScanVolume& prescan, const Fan& fan, const Picture& reference) {
  const auto value = [&](double dx, double dy) {
    const ScanConverted ours = compound(prescan, fan.picture({dx, dy}), kPointSamples);
    return agreement(ours.volume.voxels, reference.pixels, ours.mask.voxels).correlation_ratio;
  };
  const double step = 0.5;
  const double here = value(0.0, 0.0);
  return {vertex(value(-step, 0.0), here, value(step, 0.0), step),
          vertex(value(0.0, -step), here, value(0.0, step), step)};
}

void report(const std::string& what, const Agreement& a) {
  std::cout << what << ": correlation " << a.correlation << ", correlation ratio "
            << a.correlation_ratio << ", mean absolute difference " << a.mean_absolute_difference
            << ", largest " << a.largest_difference << ", pixels " << a.pixels << "\n";
}

// Plus' conversion and ours differ by rounding alone: they interpolate alike and the geometry is
// given. A wrong sign, or an offset of half a sample or half a pixel, costs three nines.
TEST(PlusData, CurvilinearFramesAreWhatPlusMadeOfThem) {
  USCT_REQUIRE_DATA(plus_file("UltrasonixCurvilinearBrightnessData.igs.mha"));
  const IgsioSequence raw = read_igsio(plus_file("UltrasonixCurvilinearBrightnessData.igs.mha"));
  const IgsioSequence plus =
      read_igsio(plus_file("UltrasonixCurvilinearScanConvertedData.igs.mha"));
  ASSERT_EQ(raw.frames.size(), 5U);
  const Fan fan;
  for (int frame = 0; frame < 5; ++frame) {
    const PreScanVolume prescan = brightness_frame(raw, frame, fan);
    const Picture theirs = picture_of(plus, frame);
    const ScanConverted tracked = compound(prescan, fan.picture(), kPointSamples);
    const ScanConverted motorised =
        scan_convert(as_motorised(prescan), fan.picture(), Interpolation::kTrilinear);
    EXPECT_EQ(tracked.volume.voxels, motorised.volume.voxels);
    EXPECT_EQ(tracked.mask.voxels, motorised.mask.voxels);
    // Plus leaves the last half line and half sample black, where our values are known.
    std::vector<std::uint8_t> both = tracked.mask.voxels;
    for (std::size_t i = 0; i < both.size(); ++i)
      if (theirs.pixels[i] == 0) both[i] = 0;
    const Agreement a = agreement(tracked.volume.voxels, theirs.pixels, both);
    const Eigen::Vector2d shift = best_shift(prescan, fan, theirs);
    report("Plus, frame " + std::to_string(frame), a);
    std::cout << "  best shift " << shift.transpose() << " pixels\n";
    EXPECT_GT(a.correlation, 0.99999);
    EXPECT_LT(a.mean_absolute_difference, 0.01);
    EXPECT_LE(a.largest_difference, 1);
    EXPECT_LT(shift.norm(), 0.02);
    // Our mask contains every pixel that Plus shows.
    for (std::size_t i = 0; i < both.size(); ++i)
      if (tracked.mask.voxels[i] == 0) {
        ASSERT_EQ(theirs.pixels[i], 0) << i;
      }
    save("plus_" + std::to_string(frame), {picture_of(tracked), theirs});
  }
}

// The scanner's own pictures are mirrored, of another geometry than the file that Plus was given
// (radius over depth 9.1 : 70.9 and not 10 : 72, 3 pixels lower: fitted once, to frame 0), and have
// other differences than geometry: grey map (black where the raw data are at 80 of 255), gain over
// depth (brighter below), and stripes across bright echoes that the scanner has smoothed. Overlaid
// in colours, the same structures coincide everywhere in the fan.
TEST(PlusData, CurvilinearFramesAreWhatTheScannerShowed) {
  USCT_REQUIRE_DATA(plus_file("UltrasonixCurvilinearBrightnessData.igs.mha"));
  const IgsioSequence raw = read_igsio(plus_file("UltrasonixCurvilinearBrightnessData.igs.mha"));
  const IgsioSequence scanner =
      read_igsio(plus_file("UltrasonixCurvilinearScanConvertedDataGroundTruth.igs.mha"));
  const Fan nominal;
  const Fan fitted{9.1, 80.04, 74.45, {410.1, 90.1}};
  const auto compare = [&](int frame, const Fan& fan, const std::string& name) {
    const Picture theirs = mirrored(picture_of(scanner, frame));
    const ScanConverted ours = compound(brightness_frame(raw, frame, fan), fan.picture(), {});
    save("scanner_" + name + "_" + std::to_string(frame), {picture_of(ours), theirs});
    return agreement(ours.volume.voxels, theirs.pixels, ours.mask.voxels);
  };
  report("scanner, nominal, frame 0", compare(0, nominal, "nominal"));
  for (int frame = 0; frame < 5; ++frame) {
    const Agreement a = compare(frame, fitted, "fitted");
    const Eigen::Vector2d shift = best_shift(brightness_frame(raw, frame, fitted), fitted,
                                             mirrored(picture_of(scanner, frame)));
    report("scanner, fitted, frame " + std::to_string(frame), a);
    std::cout << "  best shift " << shift.transpose() << " pixels\n";
    EXPECT_GT(a.correlation_ratio, 0.95);
    EXPECT_LT(shift.norm(), 0.2);
  }
}

/// ImageToProbe of the volume reconstruction examples in Plus' manual ("SpinePhantom"), in mm.
Eigen::Affine3d spine_image_to_probe() {
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  T.matrix().topRows<3>() << -0.00157821, 0.0785919, -0.00803285, 15.3978,  //
      -0.0839128, 0.00372697, 0.0153803, 49.5705,                           //
      0.0159024, 0.00714276, 0.0803604, -8.63446;
  return T;
}

TEST(PlusData, TheCompoundedSpineSweepLiesOnPlusReconstruction) {
  USCT_REQUIRE_DATA(plus_file("SpinePhantomFreehand.igs.mha"));
  const IgsioSequence sweep = read_igsio(plus_file("SpinePhantomFreehand.igs.mha"));
  IgsioTransforms calibration;
  calibration["ImageToProbe"] = {spine_image_to_probe(), "OK"};
  TrackedImages images;
  for (int frame = 0; frame < static_cast<int>(sweep.frames.size()); ++frame) {
    const OrientedImage image = oriented_frame(sweep, frame, "MF", "spine sweep");
    images.width = image.width;
    images.height = image.height;
    images.pixels.insert(images.pixels.end(), image.pixels.begin(), image.pixels.end());
    images.T_us_pixel.push_back(transform_chain(sweep.frames[static_cast<std::size_t>(frame)],
                                                calibration, "Image", "Reference", "spine sweep"));
  }
  const IgsioSequence file = read_igsio(plus_file("SpinePhantomFreehandReconstructed.mha"));
  Grid grid;
  grid.size = {147, 106, 104};
  grid.spacing_mm.setConstant(0.5);
  std::istringstream(file.fields.at("Offset")) >> grid.origin_mm.x() >> grid.origin_mm.y() >>
      grid.origin_mm.z();
  ASSERT_EQ(file.data.size(), grid.voxel_count());

  // Plus starts its volume at the corner of the box around all images, which confirms the
  // calibration.
  Eigen::AlignedBox3d box;
  for (const Eigen::Affine3d& T : images.T_us_pixel)
    for (const double u : {0.0, images.width - 1.0})
      for (const double v : {0.0, images.height - 1.0}) box.extend(T * Eigen::Vector3d(u, v, 0.0));
  EXPECT_LT((box.min() - grid.origin_mm).norm(), 0.01);

  const auto compare = [&](const Eigen::Vector3d& shift_mm, const CompoundOptions& options) {
    Grid shifted = grid;
    shifted.origin_mm += shift_mm;
    const ScanConverted ours = compound(images, shifted, options);
    std::vector<std::uint8_t> both = ours.mask.voxels;
    for (std::size_t i = 0; i < both.size(); ++i)
      if (file.data[i] == 0) both[i] = 0;  // black or not reached by Plus, without distinction
    return agreement(ours.volume.voxels, file.data, both);
  };
  // Plus spreads every pixel over its voxels, averages, and fills holes; ours works per voxel.
  const Agreement a = compare(Eigen::Vector3d::Zero(), {});
  report("spine sweep", a);
  EXPECT_GT(a.correlation, 0.998);
  EXPECT_LT(a.mean_absolute_difference, 3.1);
  Eigen::Vector3d shift_mm;
  const double step = 0.25;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d by = step * Eigen::Vector3d::Unit(axis);
    shift_mm[axis] =
        vertex(compare(-by, {}).correlation, a.correlation, compare(by, {}).correlation, step);
  }
  std::cout << "  best shift " << shift_mm.transpose() << " mm\n";
  EXPECT_LT(shift_mm.norm(), 0.05);
  CompoundOptions filled;
  filled.hole_fill_radius_mm = 1.5;
  const Agreement f = compare(Eigen::Vector3d::Zero(), filled);
  report("spine sweep, holes filled", f);
  const ScanConverted ours = compound(images, grid, filled);
  const auto slice = [&](const std::vector<std::uint8_t>& voxels) {
    const auto begin = voxels.begin() + static_cast<std::ptrdiff_t>(grid.offset(0, 0, 52));
    return Picture{147, 106, {begin, begin + 147 * 106}, {}};
  };
  save("spine", {slice(ours.volume.voxels), slice(file.data)});
  EXPECT_GT(f.correlation, 0.994);
}

}  // namespace
}  // namespace usct
