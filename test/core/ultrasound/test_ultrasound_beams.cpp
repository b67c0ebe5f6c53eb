#include <gtest/gtest.h>

#include <cmath>

#include "core/io/expect_input_error.h"
#include "streamed_sweeps.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

namespace usct::test {
namespace {

/// Brightness that rises by 2 per mm away from the probe.
std::uint8_t brightness(const Eigen::Vector3d& p_us) {
  return static_cast<std::uint8_t>(std::lround(2.0 * p_us.y() - 20.0));
}

PreScanVolume acquisition() {
  PreScanVolume volume;
  volume.geometry.axial = {50, 0.0, 1.0};
  volume.geometry.array = CurvilinearArray{40.0, centred_table(24, 0.02)};
  volume.geometry.motion = MotorSweep{27.25, centred_table(20, 0.02), 0.0};
  const BeamGrid beams = beam_grid(volume.geometry);
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l)
      for (int s = 0; s < beams.samples(); ++s)
        volume.voxels.push_back(brightness(beams.point(f, l, s)));
  return volume;
}

UsVolume cartesian() {
  Grid grid;
  grid.size = {6, 7, 8};
  UsVolume volume(grid);
  for (std::size_t i = 0; i < volume.voxels.size(); ++i)
    volume.voxels[i] = static_cast<std::uint8_t>(i % 251);
  return volume;
}

TrackedImages images() {
  TrackedImages images;
  images.width = 20;
  images.height = 30;
  for (int i = 0; i < 10; ++i) {
    Eigen::Affine3d T = Eigen::Affine3d::Identity();
    T.translation().z() = i;
    images.T_us_pixel.push_back(T);
    for (int row = 0; row < 30; ++row) images.pixels.insert(images.pixels.end(), 20, 3 * row + 10);
  }
  return images;
}

/// Each known sample of parallel beams has the brightness of its position.
template <typename Expected>
void expect_brightness(const BeamUltrasound& us, const Expected& expected) {
  std::size_t i = 0;
  int known = 0;
  for (int f = 0; f < us.beams.frames; ++f)
    for (int l = 0; l < us.beams.lines; ++l)
      for (int s = 0; s < us.beams.samples(); ++s, ++i)
        if (us.known.empty() || us.known[i] != 0) {
          ++known;
          ASSERT_NEAR(us.brightness[i], expected(us.beams.point(f, l, s)), 2.5);
        }
  EXPECT_GT(known, 1000);
}

TEST(UltrasoundBeams, OfAPreScanVolumeAreTheTrueOnes) {
  const PreScanVolume volume = acquisition();
  const UltrasoundBeams beams = beams_of(volume);
  ASSERT_TRUE(beams.geometry);
  EXPECT_FALSE(beams.grid);
  EXPECT_EQ(beams.along.beams.samples(), 50);
  EXPECT_EQ(beams.along.beams.frames, 20);
  expect_brightness(beams.along, brightness);
}

TEST(UltrasoundBeams, OfAPreScanVolumeAreParallelIfAskedFor) {
  BeamOptions options;
  options.parallel_beams_mm = 1.5;
  const UltrasoundBeams beams = beams_of(acquisition(), options);
  EXPECT_FALSE(beams.geometry);
  ASSERT_TRUE(beams.grid);
  for (const Beam& beam : beams.along.beams.beams)
    ASSERT_TRUE(beam.direction.isApprox(Eigen::Vector3d::UnitY()));
  EXPECT_EQ(beams.along.beams.axial.spacing_mm, 1.5);
  expect_brightness(beams.along, brightness);
}

TEST(UltrasoundBeams, OfACartesianVolumeRunAlongTheNamedAxis) {
  const UsVolume volume = cartesian();
  BeamOptions options;
  options.axis = parse_beam_axis("-z", "test");
  options.mask = MaskVolume(volume.grid, 255);
  options.mask.at(1, 2, 3) = 0;
  const UltrasoundBeams beams = beams_of(volume, options);
  ASSERT_TRUE(beams.grid);
  EXPECT_TRUE(same_grid(*beams.grid, volume.grid));
  EXPECT_EQ(beams.along.beams.samples(), 8);
  EXPECT_TRUE(beams.along.beams.beams[0].direction.isApprox(-Eigen::Vector3d::UnitZ()));
  EXPECT_EQ(std::count(beams.along.known.begin(), beams.along.known.end(), 0), 1);
}

TEST(UltrasoundBeams, OfImagesWithoutBeamsNeedASpacing) {
  expect_input_error([] { beams_of(images()); }, {"parallel_beams_mm", "missing"});
  BeamOptions options;
  options.parallel_beams_mm = 1.0;
  options.compounding.slice_thickness_mm = 2.0;
  expect_brightness(beams_of(images(), options).along,
                    [](const Eigen::Vector3d& p) { return 3.0 * p.y() + 10.0; });
}

/// Compounded, a frame that the tracker had elsewhere could no longer be found.
TEST(UltrasoundBeams, WrongPosesAreNotCompounded) {
  PreScanVolume volume = tracked(30);
  BeamOptions options;
  options.parallel_beams_mm = 1.0;
  beams_of(volume, options);
  std::get<TrackedSweep>(volume.geometry.motion).T_us_frame[10].translation().x() += 300.0;
  expect_input_error([&] { beams_of(volume, options); },
                     {"1 of 30 frames, frame 10 first", "compounded"});
}

TEST(UltrasoundBeams, BadOptionsAreNamed) {
  BeamOptions options;
  options.parallel_beams_mm = 0.0;
  expect_input_error([&] { beams_of(acquisition(), options); }, {"parallel_beams_mm", "> 0"});
  options.parallel_beams_mm.reset();
  options.mask = MaskVolume(cartesian().grid, 255);
  expect_input_error([&] { beams_of(acquisition(), options); }, {"'mask'", "Cartesian"});
}

}  // namespace
}  // namespace usct::test
