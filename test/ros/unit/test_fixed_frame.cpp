#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/conversions/poses.h"
#include "ros/node/refusal.h"
#include "ros/tf/fixed_frame.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {
namespace {

using Status = us_ct_registration::StatusCode;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using testing::HasSubstr;

std_msgs::Header us_at(double seconds) {
  std_msgs::Header header;
  header.frame_id = "us";
  header.stamp = ::ros::Time(seconds);
  return header;
}

Isometry3d pose(double x_mm, double angle_deg = 0.0) {
  Isometry3d T = Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(angle_deg * M_PI / 180.0, Vector3d::UnitZ()).toRotationMatrix();
  T.translation().x() = x_mm;
  return T;
}

class FixedFrameTest : public testing::Test {
 protected:
  FixedFrameTest() { options_.frame = "patient"; }

  void know(double seconds, const Isometry3d& T_mm, const std::string& parent = "patient",
            const std::string& child = "us", bool is_static = false) {
    geometry_msgs::TransformStamped transform;
    transform.header.frame_id = parent;
    transform.header.stamp = ::ros::Time(seconds);
    transform.child_frame_id = child;
    transform.transform = to_message(T_mm);
    tf_.set_transform(transform, "test", is_static);
  }
  FixedFrame frame() const { return {tf_, options_}; }
  Refusal refusal(double seconds) const {
    try {
      frame().look_up(us_at(seconds));
    } catch (const Refusal& refusal) {
      return refusal;
    }
    return {Status::OK, "no refusal"};
  }

  /// A sweep of five frames, one per second, the last of them at 100 s.
  static BeamGrid sweep_beams() {
    return beam_grid({{3, 3.0, 20.0},
                      CurvilinearArray{40.0, {-0.4, 0.4}},
                      MotorSweep{27.25, {-0.2, -0.1, 0.0, 0.1, 0.2}, 0.0}});
  }
  static std::vector<::ros::Time> sweep_stamps() {
    std::vector<::ros::Time> stamps;
    for (int i = 0; i < 5; ++i) stamps.emplace_back(96.0 + i);
    return stamps;
  }
  double compensate(const std::vector<::ros::Time>& stamps, BeamGrid& beams) const {
    return frame().compensate(us_at(100.0), frame().look_up(us_at(100.0)), stamps, beams);
  }
  Refusal sweep_refusal(const std::vector<::ros::Time>& stamps) const {
    BeamGrid beams = sweep_beams();
    try {
      compensate(stamps, beams);
    } catch (const Refusal& refusal) {
      return refusal;
    }
    return {Status::OK, "no refusal"};
  }

  TfBuffer tf_{::ros::Duration(60.0)};
  FixedFrameOptions options_;
};

/// The probe moves by 2 mm along x from frame to frame.
TEST_F(FixedFrameTest, EachFrameIsSeenFromWhereTheProbeWasThen) {
  know(96.0, pose(0.0));
  know(101.0, pose(10.0));
  const BeamGrid still = sweep_beams();
  BeamGrid beams = still;
  EXPECT_NEAR(compensate(sweep_stamps(), beams), 8.0, 1e-6);
  for (int f = 0; f < 5; ++f)
    for (int l = 0; l < 2; ++l)
      EXPECT_LT(
          (beams.point(f, l, 2) - still.point(f, l, 2) + Vector3d(8.0 - 2.0 * f, 0.0, 0.0)).norm(),
          1e-6);
}

TEST_F(FixedFrameTest, ASweepDuringWhichTheProbeMovesTooFarIsRefused) {
  know(96.0, pose(0.0));
  know(101.0, pose(14.0));  // 11.2 mm during the sweep, 2.8 mm from frame to frame
  EXPECT_EQ(sweep_refusal(sweep_stamps()).code(), Status::TF_JUMPED);
  EXPECT_THAT(sweep_refusal(sweep_stamps()).what(), HasSubstr("11.2 mm"));
  EXPECT_THAT(sweep_refusal(sweep_stamps()).what(), HasSubstr("max_sweep_motion_mm"));
  options_.max_sweep_motion_mm = 12.0;
  EXPECT_EQ(sweep_refusal(sweep_stamps()).code(), Status::OK);
}

/// The last two seconds are without motion, so that the window around the stamp notices nothing.
TEST_F(FixedFrameTest, AJumpBetweenTwoFramesIsRefused) {
  know(95.0, pose(0.0));
  know(97.4, pose(0.0));
  know(97.5, pose(4.0));
  know(101.0, pose(4.0));
  EXPECT_EQ(sweep_refusal(sweep_stamps()).code(), Status::TF_JUMPED);
  EXPECT_THAT(sweep_refusal(sweep_stamps()).what(), HasSubstr("between 97.000 s and 98.000 s"));
}

TEST_F(FixedFrameTest, TfMustReachBackToTheFirstFrame) {
  know(97.0, pose(0.0));
  know(101.0, pose(0.0));
  EXPECT_EQ(sweep_refusal(sweep_stamps()).code(), Status::TF_UNAVAILABLE);
}

TEST_F(FixedFrameTest, AProbeAtRestLeavesTheBeamsAsTheyAre) {
  know(95.0, pose(7.0, 12.0));
  know(101.0, pose(7.0, 12.0));
  const BeamGrid still = sweep_beams();
  BeamGrid beams = still;
  EXPECT_LT(compensate(sweep_stamps(), beams), 1e-6);
  for (std::size_t i = 0; i < still.beams.size(); ++i) {
    EXPECT_EQ(beams.beams[i].origin_mm, still.beams[i].origin_mm);
    EXPECT_EQ(beams.beams[i].direction, still.beams[i].direction);
  }
}

TEST_F(FixedFrameTest, WithoutFrameStampsAMotorisedSweepNeedsAProbeAtRest) {
  know(90.0, pose(4.0));
  know(96.4, pose(4.0));
  know(96.5, pose(0.0));
  know(101.0, pose(0.0));
  options_.sweep_duration_s = 4.0;
  EXPECT_EQ(sweep_refusal({}).code(), Status::TF_JUMPED);
  EXPECT_THAT(sweep_refusal({}).what(), HasSubstr("'frame_stamps'"));
  options_.sweep_duration_s = 3.0;
  EXPECT_EQ(sweep_refusal({}).code(), Status::OK);
  options_.sweep_duration_s = 11.0;
  EXPECT_EQ(sweep_refusal({}).code(), Status::TF_UNAVAILABLE);
  // The frames of a tracked sweep have poses of their own.
  BeamGrid tracked = sweep_beams();
  tracked.tracked = true;
  EXPECT_EQ(compensate({}, tracked), 0.0);
}

TEST_F(FixedFrameTest, AnyStampIsARefusalAtMost) {
  know(99.0, pose(0.0));
  for (const std::uint32_t seconds : {1U, 4294967200U, 4294967295U}) {
    std_msgs::Header us = us_at(1.0);
    us.stamp = ::ros::Time(seconds, 999999999U);
    EXPECT_THROW(frame().look_up(us), Refusal) << seconds;
    try {
      frame().require_still(us, {});
    } catch (const Refusal&) {
    }
  }
}

TEST_F(FixedFrameTest, PoseIsThatAtTheStamp) {
  know(99.0, pose(100.0));
  know(101.0, pose(102.0, 2.0));
  EXPECT_NEAR(frame().look_up(us_at(100.0)).T_fixed_us.translation().x(), 101.0, 1e-6);
  EXPECT_TRUE(
      frame().look_up(us_at(100.0)).T_fixed_us.linear().isApprox(pose(0.0, 1.0).linear(), 1e-6));
  EXPECT_EQ(frame().look_up(us_at(100.0)).age_s, 0.0);
}

TEST_F(FixedFrameTest, WithoutFixedFrameTheUltrasoundIsTheParent) {
  options_.frame = "";
  EXPECT_TRUE(frame().is_complete(us_at(100.0)));
  EXPECT_EQ(frame().name(us_at(100.0)), "us");
  EXPECT_TRUE(frame().look_up(us_at(100.0)).T_fixed_us.isApprox(Isometry3d::Identity()));
}

TEST_F(FixedFrameTest, UltrasoundInTheFixedFrameNeedsNoTf) {
  options_.frame = "us";
  EXPECT_TRUE(frame().is_complete(us_at(100.0)));
  EXPECT_TRUE(frame().look_up(us_at(100.0)).T_fixed_us.isApprox(Isometry3d::Identity()));
}

TEST_F(FixedFrameTest, StaticTransformIsCompleteAtAnyTime) {
  know(1.0, pose(7.0), "patient", "us", true);
  EXPECT_TRUE(frame().is_complete(us_at(1e6)));
  EXPECT_NEAR(frame().look_up(us_at(1e6)).T_fixed_us.translation().x(), 7.0, 1e-9);
}

TEST_F(FixedFrameTest, UnknownFramesAreUnavailable) {
  EXPECT_FALSE(frame().is_complete(us_at(100.0)));
  EXPECT_EQ(refusal(100.0).code(), Status::TF_UNAVAILABLE);
  EXPECT_THAT(refusal(100.0).what(), HasSubstr("'us'"));
  EXPECT_THAT(refusal(100.0).what(), HasSubstr("'patient'"));
  EXPECT_THAT(refusal(100.0).what(), HasSubstr("100.000"));
}

TEST_F(FixedFrameTest, UnconnectedFramesAreUnavailable) {
  know(99.0, pose(0.0), "patient", "robot");
  know(99.0, pose(0.0), "world", "us");
  EXPECT_EQ(refusal(99.0).code(), Status::TF_UNAVAILABLE);
}

TEST_F(FixedFrameTest, StampBeforeTheHistoryIsUnavailable) {
  know(100.0, pose(0.0));
  know(101.0, pose(0.0));
  EXPECT_EQ(refusal(50.0).code(), Status::TF_UNAVAILABLE);
}

TEST_F(FixedFrameTest, NewestInPlaceOfTheStampIsStale) {
  know(99.0, pose(0.0));
  know(99.5, pose(0.0));
  EXPECT_EQ(refusal(100.0).code(), Status::TF_STALE);
  EXPECT_THAT(refusal(100.0).what(), HasSubstr("0.500 s before"));
  EXPECT_THAT(refusal(100.0).what(), HasSubstr("99.500"));
}

TEST_F(FixedFrameTest, OlderTransformCountsAsFarAsAllowed) {
  know(99.0, pose(5.0));
  know(99.75, pose(6.0));
  options_.max_tf_age_s = 0.25;
  const FixedPose found = frame().look_up(us_at(100.0));
  EXPECT_NEAR(found.T_fixed_us.translation().x(), 6.0, 1e-6);
  EXPECT_NEAR(found.age_s, 0.25, 1e-9);
  EXPECT_EQ(refusal(100.01).code(), Status::TF_STALE);
}

/// The frames that tf has not reached yet are then seen from where the probe was last.
TEST_F(FixedFrameTest, OlderTransformCountsForTheLastFramesOfASweepToo) {
  know(95.0, pose(0.0));
  know(99.75, pose(0.0));
  options_.max_tf_age_s = 0.25;
  EXPECT_EQ(sweep_refusal(sweep_stamps()).code(), Status::OK);
}

/// tf takes the time 0 for the newest transform, and there the probe is elsewhere.
TEST_F(FixedFrameTest, NothingIsAskedOfTfBeforeTimeBegins) {
  options_.jump_window_s = 0.2;
  options_.sweep_duration_s = 0.5;
  know(1e-9, pose(0.0));
  know(1.0, pose(0.0));
  know(2.0, pose(50.0));
  EXPECT_EQ(refusal(0.1).code(), Status::OK);
  BeamGrid beams = sweep_beams();
  EXPECT_EQ(frame().compensate(us_at(0.1), frame().look_up(us_at(0.1)), {}, beams), 0.0);
}

TEST_F(FixedFrameTest, IsCompleteOnceTfIsPastTheWindow) {
  options_.jump_window_s = 0.2;
  know(99.0, pose(0.0));
  know(100.1, pose(0.0));
  EXPECT_TRUE(frame().reaches(us_at(100.0)));
  EXPECT_FALSE(frame().reaches(us_at(100.2)));
  EXPECT_FALSE(frame().is_complete(us_at(100.0)));
  know(100.25, pose(0.0));
  EXPECT_TRUE(frame().is_complete(us_at(100.0)));
}

/// The frame stands still, then is elsewhere: before or after the stamp, by translation or
/// rotation.
TEST_F(FixedFrameTest, JumpsOnEitherSideAreRefused) {
  options_.jump_window_s = 0.2;
  for (const double jump_at : {99.9, 100.1})
    for (const Isometry3d& there : {pose(3.5), pose(0.0, -3.5)}) {
      tf_.clear();
      know(99.0, pose(0.0));
      know(jump_at - 0.001, pose(0.0));
      know(jump_at, there);
      know(101.0, there);
      EXPECT_EQ(refusal(100.0).code(), Status::TF_JUMPED) << jump_at;
      EXPECT_THAT(refusal(100.0).what(), HasSubstr("3.5 ")) << jump_at;
      EXPECT_EQ(refusal(99.5).code(), Status::OK);
      EXPECT_EQ(refusal(100.5).code(), Status::OK);
    }
}

/// A jump that tf reports only after the pose was looked up.
TEST_F(FixedFrameTest, JumpThatTfTellsLaterIsRefusedThen) {
  options_.jump_window_s = 0.2;
  know(99.0, pose(0.0));
  know(100.05, pose(0.0));
  const FixedPose found = frame().look_up(us_at(100.0));
  know(100.1, pose(3.5));
  know(100.3, pose(3.5));
  EXPECT_THROW(frame().require_still(us_at(100.0), found), Refusal);
}

TEST_F(FixedFrameTest, MotionWithinTheLimitIsNoJump) {
  options_.jump_window_s = 0.2;
  know(99.0, pose(0.0));
  know(101.0, pose(28.0, 28.0));  // 2.8 mm and degrees in 0.2 s
  EXPECT_EQ(refusal(100.0).code(), Status::OK);
}

TEST_F(FixedFrameTest, OtherFramesAreLookedUpAtTheStamp) {
  know(99.0, pose(10.0));
  know(101.0, pose(10.0));
  know(99.0, pose(0.0), "patient", "robot");
  know(101.0, pose(40.0), "patient", "robot");
  const FixedPose found = frame().look_up(us_at(100.0));
  EXPECT_NEAR(frame().T_us_frame(us_at(100.0), found, "robot").translation().x(), 10.0, 1e-6);
  EXPECT_NEAR(frame().T_us_frame(us_at(100.0), found, "patient").translation().x(), -10.0, 1e-6);
  EXPECT_TRUE(
      frame().T_us_frame(us_at(100.0), found, "us").isApprox(Isometry3d::Identity(), 1e-12));
  for (const auto& [name, code] : std::map<std::string, int>{{"nowhere", Status::TF_UNAVAILABLE},
                                                             {"", Status::INVALID_REQUEST}}) {
    try {
      frame().T_us_frame(us_at(100.0), found, name);
      FAIL() << name;
    } catch (const Refusal& refusal) {
      EXPECT_EQ(refusal.code(), code) << refusal.what();
    }
  }
}

}  // namespace
}  // namespace usct::ros_interface
