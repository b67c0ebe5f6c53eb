#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/phantom/simple_scenes.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom::test {
namespace {

using Eigen::Vector3d;

SweepOptions tracked_sweep(int frames) {
  SweepOptions sweep;
  sweep.kind = SweepKind::kTrackedLinear;
  sweep.frames = frames;
  sweep.frame_rate_hz = 20.0;
  sweep.breathing_mm = 12.0;
  return sweep;
}

/// Whether samples `dt_s` apart are those of a sine with this amplitude and period, of any phase:
/// x(t)^2 + ((x(t + dt) - x(t - dt)) / (2 sin(w dt)))^2 is the square of the amplitude, and
/// x(t + dt) + x(t - dt) = 2 cos(w dt) x(t).
void expect_sine(const std::vector<double>& x, double dt_s, double amplitude, double period_s,
                 double tolerance) {
  const double angle = 2.0 * kPi * dt_s / period_s;
  for (std::size_t i = 1; i + 1 < x.size(); ++i) {
    const double quadrature = (x[i + 1] - x[i - 1]) / (2.0 * std::sin(angle));
    EXPECT_NEAR(std::hypot(x[i], quadrature), amplitude, tolerance) << i;
    EXPECT_NEAR(x[i + 1] + x[i - 1], 2.0 * std::cos(angle) * x[i], tolerance) << i;
  }
}

TEST(Breathing, IsASineOfTheTimesOfTheFrames) {
  SweepOptions tracked = tracked_sweep(81);
  expect_sine(make_acquisition(tracked, 60.0, 1e6, 3).breathing_mm, 0.05, 6.0, 4.0, 1e-9);
  SweepOptions motorised;
  motorised.frames = 31;
  motorised.breathing_mm = 10.0;
  motorised.breathing_period_s = 2.5;
  expect_sine(make_acquisition(motorised, 60.0, 1e6, 3).breathing_mm, 1.5 / 30, 5.0, 2.5, 1e-9);
  motorised.sweep_duration_s = 6.0;
  const auto slow = make_acquisition(motorised, 60.0, 1e6, 3).breathing_mm;
  expect_sine(slow, 6.0 / 30, 5.0, 2.5, 1e-9);
  // The phase follows from the seed.
  EXPECT_GT(std::abs(slow[0] - make_acquisition(motorised, 60.0, 1e6, 4).breathing_mm[0]), 0.01);
}

TEST(Breathing, GoesWithTheImageAndNotWithThePose) {
  SweepOptions sweep = tracked_sweep(60);
  const auto prompt = make_acquisition(sweep, 60.0, 1e6, 3).breathing_mm;
  sweep.lag_s = 0.5;  // ten frames
  const auto late = make_acquisition(sweep, 60.0, 1e6, 3).breathing_mm;
  for (std::size_t f = 10; f < late.size(); ++f) EXPECT_NEAR(late[f], prompt[f - 10], 1e-9);
  sweep.lag_s = 0.0;
  sweep.duplicate_fraction = 0.3;
  const Acquisition acquisition = make_acquisition(sweep, 60.0, 1e6, 3);
  for (std::size_t f = 0; f < prompt.size(); ++f)
    EXPECT_NEAR(acquisition.breathing_mm[f],
                prompt[static_cast<std::size_t>(acquisition.image_of_frame[f])], 1e-9);
}

/// A rod across the image plane whose echo shows, in every frame, where the anatomy is.
Scene rod_scene() {
  Scene scene = simple_scene([](const Vector3d& p_ct) {
    // The patient's superior axis (CT z) is lateral for the probe, CT y its depth.
    return std::hypot(p_ct.z(), p_ct.y() - 35.0) < 1.0 ? Tissue::kPlastic : Tissue::kAgar;
  });
  scene.tissues[Tissue::kAgar].echogenicity_db = -300.0;
  scene.tissues[Tissue::kPlastic].echogenicity_db = -300.0;
  return scene;
}

/// Turns CT z to the probe's x.
Placement sideways() {
  Placement placement;
  placement.T_probe_ct = Eigen::AngleAxisd(0.5 * kPi, Vector3d::UnitY());
  return placement;
}

/// Lateral position of the centroid of the echoes of each frame at the rod's depth.
std::vector<double> lateral_mm(const Echoes& e) {
  std::vector<double> result;
  for (int f = 0; f < e.geometry.frames(); ++f) {
    double weight = 0.0;
    double moment = 0.0;
    for (int l = 0; l < e.geometry.lines(); ++l)
      for (int s = e.sample_at(30.0); s < e.sample_at(40.0); ++s) {
        const double energy = std::pow(e.at(s, l, f), 2);
        weight += energy;
        moment += energy * us_from_scan(e.geometry, {1.0 * s, 1.0 * l, 1.0 * f}).x();
      }
    result.push_back(moment / weight);
  }
  return result;
}

TEST(Breathing, DisplacesTheFramesAsTheSineSays) {
  SweepOptions sweep = small_sweep();
  sweep.lines = 61;
  sweep.lateral_fov_deg = 30.0;
  sweep.frames = 25;
  sweep.elevation_fov_deg = 12.0;
  sweep.breathing_mm = 10.0;
  sweep.breathing_period_s = 2.0;
  sweep.sweep_duration_s = 2.4;
  const Echoes e = scan(rod_scene(), sweep, 60.0, ideal_scanner(), 2, sideways());
  const std::vector<double> x = lateral_mm(e);
  const std::vector<double> expected = make_acquisition(sweep, 60.0, 1e6, 2).breathing_mm;
  for (std::size_t f = 0; f < x.size(); ++f) EXPECT_NEAR(x[f], expected[f], 0.4) << f;
}

TEST(Breathing, OffItsOtherOptionsChangeNothing) {
  SweepOptions sweep = small_sweep();
  const Echoes plain = scan(rod_scene(), sweep, 60.0, ideal_scanner(), 2, sideways());
  sweep.breathing_period_s = 2.0;
  sweep.sweep_duration_s = 5.0;
  const Echoes same = scan(rod_scene(), sweep, 60.0, ideal_scanner(), 2, sideways());
  EXPECT_EQ(plain.envelope, same.envelope);
}

PhantomOptions agar_case() {
  PhantomOptions options;
  options.seed = 8;
  options.ct.size = {8, 8, 8};
  options.anatomy.bubbles = 0;
  options.sweep.frames = 21;
  options.sweep.elevation_fov_deg = 50.0;
  options.sweep.lines = 48;
  options.sweep.samples = 100;
  options.sweep.depth_mm = 44.0;
  return options;
}

TEST(Breathing, TruthIsTheMeanOverTheFramesThatCutTheKidney) {
  PhantomOptions options = agar_case();
  const PhantomTruth rest = make_phantom(options).truth;
  options.sweep.breathing_mm = 20.0;
  options.sweep.breathing_period_s = 3.0;
  const PhantomCase phantom = make_phantom(options);
  const PhantomTruth& truth = phantom.truth;
  const Vector3d superior_us = rest.T_us_ct.linear().col(2);
  // A frame's plane contains the motor axis, which runs along the lateral axis of the US frame.
  const double axis_y = 40.0 - 27.25;
  std::vector<double> cutting;
  for (int f = 0; f < 21; ++f) {
    const double here = truth.breathing_mm[static_cast<std::size_t>(f)];
    const double angle = (f - 10) * 2.5 * kDegree;
    int in_front = 0;
    for (const Vector3d& target : rest.targets_us_mm) {
      const Vector3d p = target + here * superior_us;
      in_front += std::atan2(p.z(), p.y() - axis_y) > angle ? 1 : 0;
    }
    if (in_front > 0 && in_front < static_cast<int>(rest.targets_us_mm.size()))
      cutting.push_back(here);
  }
  ASSERT_GT(cutting.size(), 3U);
  double mean = 0.0;
  for (const double b : cutting) mean += b / static_cast<double>(cutting.size());
  ASSERT_GT(std::abs(mean), 1.0);
  for (std::size_t i = 0; i < rest.targets_us_mm.size(); ++i)
    EXPECT_LT((truth.targets_us_mm[i] - rest.targets_us_mm[i] - mean * superior_us).norm(), 1e-9);
  EXPECT_LT(truth.max_residual_mm, 1e-9);
  const auto json = nlohmann::json::parse(describe_json(phantom));
  EXPECT_EQ(json["options"]["sweep"]["breathing_mm"], 20.0);
  EXPECT_EQ(json["truth"]["breathing_mm"].get<std::vector<double>>(), truth.breathing_mm);
}

/// In a sweep that is short against a breath, the anatomy stands still beside its place at rest:
/// the steel balls must be where the truth says.
TEST(Breathing, ImageAndTruthMoveTheSameWay) {
  PhantomOptions options = agar_case();
  options.sweep.frames = 61;
  options.sweep.lines = 96;
  const PhantomTruth rest = make_phantom(options).truth;
  options.sweep.breathing_mm = 16.0;
  options.sweep.breathing_period_s = 20.0;
  options.sweep.sweep_duration_s = 0.05;
  const PhantomCase phantom = make_phantom(options);
  const auto& us = phantom.ultrasound;
  ASSERT_GT((phantom.truth.T_us_ct.translation() - rest.T_us_ct.translation()).norm(), 3.0);
  for (const Vector3d& ball : phantom.truth.fiducials_us_mm) {
    Vector3d brightest = Vector3d::Zero();
    int level = -1;
    for (int f = 0; f < us.geometry.frames(); ++f)
      for (int l = 0; l < us.geometry.lines(); ++l)
        for (int s = 0; s < us.geometry.samples(); ++s) {
          const Vector3d p = us_from_scan(us.geometry, {1.0 * s, 1.0 * l, 1.0 * f});
          if ((p - ball).norm() > 6.0 || us.at(s, l, f) <= level) continue;
          level = us.at(s, l, f);
          brightest = p;
        }
    EXPECT_LT((brightest - ball).norm(), 1.8);
  }
}

}  // namespace
}  // namespace usct::phantom::test
