#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/io/expect_input_error.h"
#include "core/ultrasound/lagging_sweep.h"
#include "us_ct_registration/ultrasound/image_lag.h"

namespace usct {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;
using test::expect_input_error;
using test::sweep_of;
using test::SweepCase;
using test::unsteady_mm;

TrackedSweep screw(int frames, double interval_s) {
  TrackedSweep sweep;
  for (int i = 0; i < frames; ++i) {
    sweep.T_us_frame.emplace_back(Translation3d(2.0 * i, -1.0 * i, 0.5) *
                                  AngleAxisd(0.05 * i, Vector3d(1, 2, -1).normalized()));
    sweep.frame_times_s.push_back(10.0 + interval_s * i);
  }
  return sweep;
}

void expect_same(const Isometry3d& a, const Isometry3d& b) {
  EXPECT_LT((a.matrix() - b.matrix()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(PoseAt, FollowsASteadyScrewBetweenFramesAndEndsWithIt) {
  const TrackedSweep sweep = screw(4, 0.5);
  expect_same(*pose_at(sweep, 10.0), sweep.T_us_frame[0]);
  expect_same(*pose_at(sweep, 11.5), sweep.T_us_frame[3]);
  // A steady turn and shift: index 1.3.
  const Isometry3d expected(Translation3d(2.6, -1.3, 0.5) *
                            AngleAxisd(0.065, Vector3d(1, 2, -1).normalized()));
  expect_same(*pose_at(sweep, 10.65), expected);
  EXPECT_FALSE(pose_at(sweep, 9.999));
  EXPECT_FALSE(pose_at(sweep, 11.501));
}

TEST(CorrectImageLag, ShiftsPosesAndDropsTheEndThatHasNone) {
  const TrackedSweep sweep = screw(5, 0.5);
  const LagCorrected late = correct_image_lag(sweep, 0.75, "sweep");
  EXPECT_THAT(late.frames, testing::ElementsAre(2, 3, 4));
  ASSERT_EQ(late.sweep.frame_times_s.size(), 3u);
  EXPECT_DOUBLE_EQ(late.sweep.frame_times_s[0], 10.25);
  EXPECT_NEAR(late.sweep.T_us_frame[0].translation().x(), 1.0, 1e-12);  // index 0.5
  EXPECT_NEAR(late.sweep.T_us_frame[2].translation().x(), 5.0, 1e-12);  // index 2.5

  EXPECT_THAT(correct_image_lag(sweep, -0.5, "sweep").frames, testing::ElementsAre(0, 1, 2, 3));
}

TEST(CorrectImageLag, SaysWhyItCannot) {
  expect_input_error([] { correct_image_lag(screw(5, 0.5), 2.5, "sweep"); },
                     {"sweep", "2.5", "2.0"});
  TrackedSweep timeless = screw(5, 0.5);
  timeless.frame_times_s.clear();
  expect_input_error([&] { correct_image_lag(timeless, 0.1, "sweep"); }, {"sweep", "time"});
  expect_input_error([] { correct_image_lag(screw(5, 0.5), std::nan(""), "sweep"); }, {"finite"});
}

TEST(EstimateLag, FindsAKnownLagEitherWay) {
  for (const double lag_s : {-0.9, -0.13, 0.0, 0.21, 0.5, 1.2}) {
    SweepCase how;
    how.lag_s = lag_s;
    how.along_mm = unsteady_mm;
    const LagEstimate estimate = estimate_lag(sweep_of(how, 3));
    EXPECT_TRUE(estimate.determined) << lag_s << ": " << estimate.message;
    EXPECT_NEAR(estimate.lag_s, lag_s, 0.03);  // frames are 0.05 s apart
    EXPECT_LE(estimate.interval_s.first, estimate.lag_s + 0.01);
    EXPECT_GE(estimate.interval_s.second, estimate.lag_s - 0.01);
    EXPECT_GT(estimate.correlation, 0.7);
    EXPECT_GT(estimate.correlation, estimate.next_correlation);
  }
}

/// Position at a speed of 15 mm/s with eight random waves, slow ones among them.
std::function<double(double)> another_hand_mm(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<std::pair<double, double>> waves;
  for (int i = 0; i < 8; ++i)
    waves.emplace_back(0.3 + 3.5 * uniform(random), 2.0 * kPi * uniform(random));
  return [waves](double t) {
    double along_mm = 15.0 * t;
    for (const auto& [frequency, phase] : waves)
      along_mm += 15.0 * 0.17 / frequency * std::sin(frequency * t + phase);
    return along_mm;
  };
}

/// A bias stays however many sweeps are averaged.
TEST(EstimateLag, IsNotDrawnTowardsZero) {
  double sum_s = 0.0;
  int determined = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    SweepCase how;
    how.lag_s = 1.0;
    how.along_mm = another_hand_mm(seed);
    const LagEstimate estimate = estimate_lag(sweep_of(how, seed));
    if (!estimate.determined) continue;
    ++determined;
    sum_s += estimate.lag_s - how.lag_s;
  }
  EXPECT_GE(determined, 15);
  EXPECT_NEAR(sum_s / determined, 0.0, 0.008);
}

TEST(EstimateLag, RepeatedImagesAndSparseFramesDoNotShiftIt) {
  SweepCase how;
  how.lag_s = 0.4;
  how.repeat_every = 7;
  how.along_mm = unsteady_mm;
  const LagEstimate repeated = estimate_lag(sweep_of(how, 4));
  EXPECT_TRUE(repeated.determined) << repeated.message;
  EXPECT_NEAR(repeated.lag_s, 0.4, 0.03);
  EXPECT_EQ(repeated.repeated_images, 29);

  how.repeat_every = 0;
  how.interval_s = 0.2;
  how.duration_s = 30.0;
  const LagEstimate sparse = estimate_lag(sweep_of(how, 4));
  EXPECT_TRUE(sparse.determined) << sparse.message;
  EXPECT_NEAR(sparse.lag_s, 0.4, 0.1);
}

TEST(EstimateLag, AFlashDoesNotDecide) {
  SweepCase how;
  how.lag_s = 0.3;
  how.along_mm = unsteady_mm;
  PreScanVolume volume = sweep_of(how, 5);
  for (std::size_t i = 100 * 160; i < 101 * 160; ++i) volume.voxels[i] = 255;
  const LagEstimate estimate = estimate_lag(volume);
  EXPECT_TRUE(estimate.determined) << estimate.message;
  EXPECT_NEAR(estimate.lag_s, 0.3, 0.03);
}

TEST(EstimateLag, IsTheSameForImages) {
  SweepCase how;
  how.lag_s = 0.35;
  how.along_mm = unsteady_mm;
  const PreScanVolume volume = sweep_of(how, 6);
  const auto& sweep = std::get<TrackedSweep>(volume.geometry.motion);
  TrackedImages images;
  images.width = 16;
  images.height = 10;
  images.pixels = volume.voxels;
  images.times_s = sweep.frame_times_s;
  for (const Isometry3d& T : sweep.T_us_frame) {
    Eigen::Affine3d T_us_pixel(T.matrix());  // columns run along the lines
    Eigen::Matrix3d axes;
    axes << 0.0, 2.0, 0.0, 1.1, 0.0, 0.0, 0.0, 0.0, 1.0;
    T_us_pixel = T_us_pixel * Translation3d(-9.0, 0.0, 0.0) * Eigen::Affine3d(axes);
    images.T_us_pixel.push_back(T_us_pixel);
  }
  EXPECT_NEAR(estimate_lag(images).lag_s, estimate_lag(volume).lag_s, 1e-9);
  images.times_s.clear();
  expect_input_error([&] { estimate_lag(images); }, {"times"});
}

TEST(EstimateLag, SaysWhereTheSweepDoesNotTell) {
  using testing::HasSubstr;
  SweepCase how;
  how.along_mm = [](double t) { return 10.0 * t; };
  EXPECT_THAT(estimate_lag(sweep_of(how, 7)).message, HasSubstr("speed varies by only"));
  how.along_mm = [](double) { return 0.0; };
  EXPECT_THAT(estimate_lag(sweep_of(how, 7)).message, HasSubstr("does not move"));
  how.along_mm = unsteady_mm;
  how.duration_s = 0.9;
  EXPECT_THAT(estimate_lag(sweep_of(how, 7)).message, HasSubstr("pairs of consecutive frames"));
}

TEST(EstimateLag, ImagesThatDoNotFollowTheProbeAreSeldomBelieved) {
  int believed = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    SweepCase how;
    how.along_mm = unsteady_mm;
    PreScanVolume volume = sweep_of(how, seed);
    // The image change is that of another hand's sweep, unrelated to the poses.
    how.along_mm = [seed](double t) {
      return 10.0 * t - 3.0 * std::cos(2.3 * t + seed) - 1.0 * std::cos(5.3 * t + 2.0 * seed);
    };
    volume.voxels = sweep_of(how, seed).voxels;
    believed += estimate_lag(volume).determined ? 1 : 0;
  }
  EXPECT_LE(believed, 2);
}

TEST(EstimateLag, RefusesSweepsWithoutPosesOrTimes) {
  SweepCase how;
  how.along_mm = unsteady_mm;
  PreScanVolume volume = sweep_of(how, 8);
  std::get<TrackedSweep>(volume.geometry.motion).frame_times_s.clear();
  expect_input_error([&] { estimate_lag(volume); }, {"times"});
  volume.geometry.array =
      CurvilinearArray{60.0, {-0.4, -0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3, 0.4, 0.5}};
  MotorSweep motor{27.0, {}, 0.0};
  for (int i = 0; i < 200; ++i) motor.frame_angles_rad.push_back(0.001 * i);
  volume.geometry.motion = motor;
  expect_input_error([&] { estimate_lag(volume); }, {"motorised"});
}

}  // namespace
}  // namespace usct
