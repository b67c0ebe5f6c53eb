#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <functional>
#include <limits>
#include <random>

#include "core/io/expect_input_error.h"
#include "random_geometry.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/motor_calibration.h"
#include "us_ct_registration/geometry/scan_geometry.h"

namespace usct {
namespace {

using test::integer;
using test::uniform;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// The in-plane position at which a frame at a motor angle cuts a wire along z at depth y, by the
/// geometry of the probe and not by eq 3.1.
double cut_mm(double wire_y_mm, double motor_angle_rad) {
  const Eigen::Isometry3d T = T_us_frame_at_motor_angle(40.0, 27.25, motor_angle_rad);
  // p_us = T * (0, v, 0); p_us.y == wire_y.
  return (wire_y_mm - T.translation().y()) / T.linear()(1, 1);
}

/// A phantom with wires 25 mm apart, swept `volumes` times by a probe with the given motor angles.
WireDistances sweep_wires(const std::vector<double>& angles_rad, int volumes, double noise_mm,
                          unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  WireDistances distances;
  distances.true_distance_mm = 25.0;
  for (int volume = 0; volume < volumes; ++volume) {
    distances.volumes.emplace_back();
    for (const double angle : angles_rad)
      distances.volumes.back().push_back(cut_mm(105.0, angle) - cut_mm(80.0, angle) +
                                         noise_mm * normal(generator));
  }
  return distances;
}

/// Motor angles that cross zero at `zero_frame`, with different steps before and after.
std::vector<double> two_halves(int frames, double zero_frame, double before_deg, double after_deg) {
  std::vector<double> angles;
  for (int frame = 0; frame < frames; ++frame)
    angles.push_back((frame - zero_frame) * (frame < zero_frame ? before_deg : after_deg) *
                     kDegree);
  return angles;
}

// The experiment of the thesis: nine volumes, one half slower. 0.15 mm is half a sample of the
// thesis' data; the bands are four standard errors, which must themselves agree with the noise.
TEST(MotorCalibration, RecoversTheThesisSweepFromNineNoisyVolumes) {
  const std::vector<double> truth = two_halves(97, 47.3, 0.611, 0.747);
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const MotorCalibration result =
        calibrate_motor(sweep_wires(truth, 9, 0.15, seed), {}, "wires.csv");
    EXPECT_LT(result.before.standard_error_rad, 0.005 * kDegree);
    EXPECT_LT(result.after.standard_error_rad, 0.005 * kDegree);
    EXPECT_GT(result.before.standard_error_rad, 0.0002 * kDegree);
    EXPECT_NEAR(result.before.step_rad, 0.611 * kDegree, 4.0 * result.before.standard_error_rad);
    EXPECT_NEAR(result.after.step_rad, 0.747 * kDegree, 4.0 * result.after.standard_error_rad);
    EXPECT_NEAR(result.zero_frame, 47.3, 4.0 * result.zero_frame_standard_error);
    EXPECT_NEAR(result.rms_residual_mm, 0.15 / 3.0, 0.015);  // of means over nine
    ASSERT_EQ(result.frame_angles_rad.size(), truth.size());
    for (std::size_t frame = 0; frame < truth.size(); ++frame)
      EXPECT_NEAR(result.frame_angles_rad[frame], truth[frame], 0.35 * kDegree) << frame;
  }
}

// Standard errors are right: over many sweeps they match the errors.
TEST(MotorCalibration, StandardErrorsMatchTheScatterOfRepeatedCalibrations) {
  const std::vector<double> truth = two_halves(97, 47.3, 0.611, 0.747);
  double squares = 0.0;
  const int runs = 300;
  for (int run = 0; run < runs; ++run) {
    const MotorCalibration result = calibrate_motor(
        sweep_wires(truth, 9, 0.15, 1000U + static_cast<unsigned>(run)), {}, "wires.csv");
    const double z = (result.before.step_rad - 0.611 * kDegree) / result.before.standard_error_rad;
    squares += z * z;
  }
  // Mean of 300 squared standard normals: 1 +- 0.08; four times that.
  EXPECT_NEAR(squares / runs, 1.0, 0.33);
}

/// A frame that more volumes show counts as often: the fit is the least-squares fit of all single
/// distances, which no small change of its parameters makes better.
TEST(MotorCalibration, EveryDistanceCountsOnce) {
  WireDistances distances = sweep_wires(two_halves(60, 29.4, 0.611, 0.747), 5, 0.05, 11);
  for (std::size_t volume = 1; volume < 5; ++volume)
    for (std::size_t frame = 0; frame < 60; ++frame)
      if (frame % 7 != 0 && frame < 45) distances.volumes[volume][frame] = kNaN;
  const MotorCalibration result = calibrate_motor(distances, {}, "wires.csv");
  const auto cost = [&](double zero_frame, double before_rad, double after_rad) {
    double sum = 0.0;
    for (const std::vector<double>& volume : distances.volumes)
      for (std::size_t frame = 0; frame < volume.size(); ++frame) {
        const double from_zero = static_cast<double>(frame) - zero_frame;
        const double angle = from_zero * (from_zero < 0.0 ? before_rad : after_rad);
        if (!std::isnan(volume[frame]))
          sum += std::pow(volume[frame] - distances.true_distance_mm / std::cos(angle), 2.0);
      }
    return sum;
  };
  const double zero = result.zero_frame;
  const double before = result.before.step_rad;
  const double after = result.after.step_rad;
  const double least = cost(zero, before, after);
  for (const double sign : {-1.0, 1.0}) {
    EXPECT_GT(cost(zero + sign * 1e-3, before, after), least);
    EXPECT_GT(cost(zero, before + sign * 1e-6, after), least);
    EXPECT_GT(cost(zero, before, after + sign * 1e-6), least);
  }
}

// Without noise every table is returned exactly, whatever the sweep, from either direction.
RC_GTEST_PROP(MotorCalibration, IsExactWithoutNoise, ()) {
  const int frames = integer(20, 150);
  const double zero = uniform(0.35, 0.65) * (frames - 1);
  const double widest = 38.0 / (0.65 * frames);  // degrees per frame
  const std::vector<double> truth =
      two_halves(frames, zero, uniform(0.5, 1.0) * widest, uniform(0.5, 1.0) * widest);
  WireDistances distances = sweep_wires(truth, integer(1, 4), 0.0, 0);
  MotorCalibrationOptions options;
  options.rising = integer(0, 2) == 0;
  options.fit_distance = integer(0, 2) == 0;
  // Some frames of some volumes show no wires.
  for (int n = 0; n < frames / 10; ++n)
    distances.volumes[0][static_cast<std::size_t>(integer(0, frames))] = kNaN;
  const MotorCalibration result = calibrate_motor(distances, options, "wires.csv");
  const double sense = options.rising ? 1.0 : -1.0;
  RC_ASSERT(std::abs(result.before.step_rad - sense * (truth[1] - truth[0])) < 1e-6);
  RC_ASSERT(std::abs(result.after.step_rad - sense * (truth.end()[-1] - truth.end()[-2])) < 1e-6);
  for (std::size_t frame = 0; frame < truth.size(); ++frame) {
    RC_ASSERT(std::abs(result.frame_angles_rad[frame] - sense * truth[frame]) < 1e-6);
    const SliceAngle& slice = result.slices[frame];
    if (slice.status == SliceAngle::Status::kMeasured && std::abs(truth[frame]) > 0.01)
      RC_ASSERT(std::abs(slice.angle_rad - sense * truth[frame]) < 1e-5);
  }
  RC_ASSERT(std::abs(result.zero_frame - zero) < 1e-5);
  RC_ASSERT(std::abs(result.distance_mm - 25.0) < 1e-6);
}

// Near zero angle noise makes h < d, where eq 3.1 has no solution: such frames are named, never
// NaN.
TEST(MotorCalibration, AMotorThatDoesNotMoveIsRefused) {
  WireDistances distances;
  distances.true_distance_mm = 10.0;
  distances.volumes.assign(1, std::vector<double>(41, 10.0));
  test::expect_input_error([&] { calibrate_motor(distances, {}, "wires.csv"); },
                           {"wires.csv", "is the same in all frames"});
}

TEST(MotorCalibration, FramesBelowTheTrueDistanceAreNamed) {
  const WireDistances distances = sweep_wires(two_halves(97, 47.3, 0.611, 0.747), 1, 0.15, 7);
  const MotorCalibration result = calibrate_motor(distances, {}, "wires.csv");
  int below = 0;
  for (std::size_t frame = 0; frame < result.slices.size(); ++frame) {
    const SliceAngle& slice = result.slices[frame];
    EXPECT_TRUE(std::isfinite(slice.angle_rad));
    const bool is_below = distances.volumes[0][frame] <= 25.0;
    EXPECT_EQ(slice.status,
              is_below ? SliceAngle::Status::kAtMinimum : SliceAngle::Status::kMeasured);
    below += is_below ? 1 : 0;
  }
  EXPECT_GT(below, 2);  // the case occurs
}

// Water at 20 degrees on a scanner set to 1540 m/s shows distances 4 % too long. A known distance
// is then refused or distorts the angles; with a fitted distance the angles are right.
TEST(MotorCalibration, FitsTheDistanceWhereTheSoundSpeedIsOff) {
  const std::vector<double> truth = two_halves(97, 47.3, 0.611, 0.747);
  WireDistances distances = sweep_wires(truth, 9, 0.15, 3);
  for (auto& volume : distances.volumes)
    for (double& h : volume) h *= 1.04;
  MotorCalibrationOptions options;
  options.fit_distance = true;
  const MotorCalibration result = calibrate_motor(distances, options, "wires.csv");
  EXPECT_NEAR(result.distance_mm, 26.0, 4.0 * result.distance_standard_error_mm);
  EXPECT_LT(result.distance_standard_error_mm, 0.05);
  EXPECT_NEAR(result.before.step_rad, 0.611 * kDegree, 4.0 * result.before.standard_error_rad);
  EXPECT_NEAR(result.after.step_rad, 0.747 * kDegree, 4.0 * result.after.standard_error_rad);
}

TEST(MotorCalibration, RefusesWhatIsNoSweepOverWires) {
  const std::vector<double> good = two_halves(60, 30.2, 0.6, 0.7);
  const auto message = [&](const std::function<void(WireDistances&, MotorCalibrationOptions&)>& f) {
    WireDistances distances = sweep_wires(good, 2, 0.0, 0);
    MotorCalibrationOptions options;
    f(distances, options);
    try {
      calibrate_motor(distances, options, "wires.csv");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  using W = WireDistances;
  using O = MotorCalibrationOptions;
  EXPECT_EQ(message([](W&, O&) {}), "accepted");
  EXPECT_EQ(message([](W& w, O&) { w.true_distance_mm = 0.0; }),
            "wires.csv: true distance is 0.000000 mm, must be finite and > 0");
  EXPECT_EQ(message([](W& w, O&) { w.volumes.clear(); }),
            "wires.csv: has no volumes, must have at least 1");
  EXPECT_EQ(
      message([](W& w, O&) { w.volumes[1].pop_back(); }),
      "wires.csv: volume 1 has 59 frames, must have at least 8 and as many as the others (60)");
  EXPECT_EQ(message([](W& w, O&) { w.volumes[1][3] = -2.0; }),
            "wires.csv: volume 1, frame 3: distance is -2.000000 mm, must be finite and > 0");
  EXPECT_EQ(message([](W&, O& o) { o.residual_tolerance = kNaN; }),
            "wires.csv: 'residual_tolerance' is nan, must be finite and > 0");
  // If d is larger than the shown distances, no angle has that cosine.
  EXPECT_NE(message([](W& w, O&) { w.true_distance_mm = 26.0; }).find("below their true distance"),
            std::string::npos);
  // The sweep covers one side only.
  EXPECT_NE(message([](W& w, O&) {
              for (auto& volume : w.volumes) volume.assign(volume.begin() + 30, volume.end());
            }).find("wires.csv: the "),
            std::string::npos);
  // The segmentation is wrong.
  EXPECT_NE(message([](W& w, O&) {
              for (auto& volume : w.volumes)
                for (std::size_t i = 0; i < volume.size(); i += 3) volume[i] += 6.0;
            }).find("scatter about the fitted sweep"),
            std::string::npos);
  // Hardly any frame shows the wires.
  EXPECT_NE(message([](W& w, O&) {
              for (auto& volume : w.volumes)
                for (std::size_t i = 0; i + 7 < volume.size(); ++i) volume[i] = kNaN;
            }).find("found in 7 frames, must be at least 8"),
            std::string::npos);
}

}  // namespace
}  // namespace usct
