#include <gtest/gtest.h>

#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/probe_motion.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kProbeRadiusMm = 40.0;
constexpr double kMotorRadiusMm = 27.25;

ScanGeometry sweep(const std::vector<double>& angles_rad) {
  return {{11, 3.0, 7.0},
          CurvilinearArray{kProbeRadiusMm, {-0.5, 0.1, 0.6}},
          MotorSweep{kMotorRadiusMm, angles_rad, 0.02}};
}

/// A probe that turns about the axis of its motor does what the motor does: a sweep by small motor
/// angles then is one by larger angles.
TEST(ProbeMotion, TurnAboutTheMotorAxisIsALargerSweep) {
  const std::vector<double> motor_rad{-0.30, -0.05, 0.11, 0.40};
  const std::vector<double> probe_rad{0.08, -0.02, 0.05, 0.0};
  std::vector<double> both_rad;
  std::vector<Isometry3d> T_us_then;
  for (std::size_t i = 0; i < motor_rad.size(); ++i) {
    both_rad.push_back(motor_rad[i] + probe_rad[i]);
    T_us_then.push_back(T_us_frame_at_motor_angle(kProbeRadiusMm, kMotorRadiusMm, probe_rad[i]));
  }
  BeamGrid grid = beam_grid(sweep(motor_rad));
  follow_probe(T_us_then, grid);
  const BeamGrid expected = beam_grid(sweep(both_rad));
  for (int frame = 0; frame < grid.frames; ++frame)
    for (int line = 0; line < grid.lines; ++line)
      for (const int sample : {0, 10})
        EXPECT_LT((grid.point(frame, line, sample) - expected.point(frame, line, sample)).norm(),
                  1e-9);
}

TEST(ProbeMotion, IsTheLongestWayOfASample) {
  const BeamGrid grid = beam_grid(sweep({-0.1, 0.0, 0.1}));
  std::vector<Isometry3d> T_us_then(3, Isometry3d::Identity());
  EXPECT_EQ(probe_motion_mm(grid, T_us_then), 0.0);
  T_us_then[1] = Eigen::Translation3d(3.0, 0.0, -4.0);
  EXPECT_NEAR(probe_motion_mm(grid, T_us_then), 5.0, 1e-12);
  // The deepest sample of frame 1 is 113 mm from the z axis, about which the frame turns.
  T_us_then[1] = Eigen::AngleAxisd(0.2, Vector3d::UnitZ());
  EXPECT_NEAR(probe_motion_mm(grid, T_us_then), 2.0 * std::sin(0.1) * 113.0, 1e-9);
}

/// All lines of a frame have its pose if the motor stops for each frame.
TEST(ProbeMotion, OfAGeometryIsThatOfItsBeams) {
  ScanGeometry geometry = sweep({-0.1, 0.0, 0.1});
  std::get<MotorSweep>(geometry.motion).frame_travel_rad = 0.0;
  std::vector<Isometry3d> T_us_then;
  for (const double share : {0.3, 0.1, 0.0})
    T_us_then.push_back(Eigen::Translation3d(20.0 * share, 3.0, -share) *
                        Eigen::AngleAxisd(share, Vector3d(1, 2, 3).normalized()));
  BeamGrid expected = beam_grid(geometry);
  follow_probe(T_us_then, expected);
  const ScanGeometry followed = follow_probe(T_us_then, geometry);
  EXPECT_FALSE(followed.is_motorised());
  // A tracked sweep is followed in the same way: back to where it was.
  for (Isometry3d& T : T_us_then) T = T.inverse();
  const BeamGrid found = beam_grid(followed);
  const BeamGrid back = beam_grid(follow_probe(T_us_then, followed));
  const BeamGrid original = beam_grid(geometry);
  for (int frame = 0; frame < expected.frames; ++frame)
    for (int line = 0; line < expected.lines; ++line)
      for (const int sample : {0, 10}) {
        EXPECT_LT((found.point(frame, line, sample) - expected.point(frame, line, sample)).norm(),
                  1e-9);
        EXPECT_LT((back.point(frame, line, sample) - original.point(frame, line, sample)).norm(),
                  1e-9);
      }
}

/// Without them a lag between images and poses could no longer be corrected.
TEST(ProbeMotion, ATrackedSweepKeepsTheTimesOfItsFrames) {
  const std::vector<double> times_s{0.0, 0.05, 0.2};
  const std::vector<Isometry3d> still(3, Isometry3d::Identity());
  const ScanGeometry tracked{
      {11, 3.0, 7.0}, LinearArray{{-5.0, 0.0, 5.0}}, TrackedSweep{still, times_s}};
  EXPECT_EQ(std::get<TrackedSweep>(follow_probe(still, tracked).motion).frame_times_s, times_s);
}

/// The motor travels by 0.02 rad while a frame is acquired, and is at its angle in the middle of
/// it.
TEST(ProbeMotion, AFrameOfAMovingMotorGetsThePoseOfItsMiddle) {
  const ScanGeometry followed =
      follow_probe({Isometry3d::Identity(), Isometry3d::Identity()}, sweep({-0.1, 0.2}));
  const auto& poses = std::get<TrackedSweep>(followed.motion).T_us_frame;
  ASSERT_EQ(poses.size(), 2U);
  for (const auto& [pose, angle_rad] : {std::pair(poses[0], -0.1), std::pair(poses[1], 0.2)})
    EXPECT_TRUE(
        pose.isApprox(T_us_frame_at_motor_angle(kProbeRadiusMm, kMotorRadiusMm, angle_rad), 1e-12));
}

TEST(ProbeMotion, NeedsOnePosePerFrame) {
  BeamGrid grid = beam_grid(sweep({-0.1, 0.0, 0.1}));
  EXPECT_THROW(follow_probe({Isometry3d::Identity()}, grid), InputError);
  EXPECT_THROW(probe_motion_mm(grid, {}), InputError);
  EXPECT_THROW(follow_probe({Isometry3d::Identity()}, sweep({-0.1, 0.0, 0.1})), InputError);
}

}  // namespace
}  // namespace usct
