#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

#include "ros/conversions/poses.h"
#include "ros/node/refusal.h"
#include "ros/registration/initial_alignments.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Status = msg::StatusCode;
using SetRequest = msg::SetInitialAlignment::Request;
using Eigen::Isometry3d;
using Eigen::Vector3d;

Isometry3d shifted(double x_mm) {
  Isometry3d T = Isometry3d::Identity();
  T.translation().x() = x_mm;
  return T;
}

constexpr std::uint32_t kCt = 77;

/// Ultrasound 1000 mm along x in the fixed frame "patient".
class InitialAlignmentsTest : public testing::Test {
 protected:
  InitialAlignmentsTest() {
    us_->header.frame_id = "us";
    us_->header.stamp = ::ros::Time(100.0);
    us_->pose.T_fixed_us = shifted(1000.0);
  }

  static FixedFrameOptions patient() {
    FixedFrameOptions options;
    options.frame = "patient";
    return options;
  }
  double set(const SetRequest& request, const std::optional<CtIdentity>& ct = {}) {
    return alignments_.set(request, ct,
                           [this]() -> std::shared_ptr<const HeldUltrasound> { return us_; });
  }
  SetRequest pose(const std::string& frame, double x_mm) const {
    SetRequest request;
    request.type = SetRequest::POSE;
    request.header.frame_id = frame;
    request.transform = to_message(shifted(x_mm));
    return request;
  }
  void accept(std::uint8_t state, double x_mm, std::uint64_t result_id,
              const std::string& ct_frame = "ct", std::uint32_t ct_crc32 = kCt) {
    auto alignment = boost::make_shared<msg::Alignment>();
    alignment->state = state;
    alignment->header.frame_id = "patient";
    alignment->header.stamp = ::ros::Time(90.0);  // of the ultrasound
    alignment->ct_frame = ct_frame;
    alignment->ct_crc32 = ct_crc32;
    alignment->policy = "auto";
    alignment->result_id = result_id;
    // Simulated time may jump back, so that it orders nothing.
    alignment->accepted = ::ros::Time(7.0);
    if (state != msg::Alignment::NONE) alignment->transform = to_message(shifted(x_mm));
    alignments_.arrived(alignment);
  }
  static HeldCt held_ct(std::uint32_t crc32) {
    HeldCt ct;
    ct.header.frame_id = "ct";
    ct.crc32 = crc32;
    return ct;
  }
  /// Source and x of T_us_ct, mm.
  std::string chosen(const std::optional<geometry_msgs::TransformStamped>& goal = {},
                     std::uint32_t ct_crc32 = kCt, std::uint64_t now_ms = 50) {
    const auto found = alignments_.choose(goal, *us_, held_ct(ct_crc32), now_ms);
    if (!found) return "none";
    return found->source + " " + std::to_string(std::lround(found->T_us_ct.translation().x()));
  }
  template <typename F>
  int code_of(F&& ask) const {
    try {
      ask();
    } catch (const Refusal& refusal) {
      return refusal.code();
    }
    return Status::OK;
  }

  TfBuffer tf_;
  FixedFrame frame_{tf_, patient()};
  std::shared_ptr<HeldUltrasound> us_ = std::make_shared<HeldUltrasound>();
  InitialAlignments alignments_{frame_, FramedAlignment{"us", shifted(4.0)}};
};

TEST_F(InitialAlignmentsTest, FirstThatExistsCounts) {
  EXPECT_EQ(chosen(), "parameters 4");
  accept(msg::Alignment::RESTORED, 1003.0, 0);
  EXPECT_EQ(chosen(), "restored 3");
  accept(msg::Alignment::ACCEPTED, 1005.0, 20);
  EXPECT_EQ(chosen(), "accepted 5");
  set(pose("us", 2.0));
  EXPECT_EQ(chosen(), "set 2");
  geometry_msgs::TransformStamped goal;
  goal.header.frame_id = "patient";
  goal.transform = to_message(shifted(1001.0));
  EXPECT_EQ(chosen(goal), "goal 1");
  EXPECT_EQ(chosen(), "set 2");
}

TEST_F(InitialAlignmentsTest, SetLastsUntilClearedOrAResultIsAccepted) {
  set(pose("us", 2.0));
  accept(msg::Alignment::ACCEPTED, 1005.0, 20);  // from before the alignment was set
  EXPECT_EQ(chosen(), "set 2");
  accept(msg::Alignment::RESTORED, 1005.0, 0);
  EXPECT_EQ(chosen(), "set 2");
  accept(msg::Alignment::ACCEPTED, 1006.0, 60);
  EXPECT_EQ(chosen(), "accepted 6");
  set(pose("us", 7.0));
  EXPECT_EQ(chosen({}, kCt, 70), "set 7");
  SetRequest clear;
  clear.type = SetRequest::CLEAR;
  set(clear);
  EXPECT_EQ(chosen(), "accepted 6");
  accept(msg::Alignment::NONE, 0.0, 0);
  EXPECT_EQ(chosen(), "parameters 4");
}

/// A registration that ran while it was set started elsewhere, and gives its result later.
TEST_F(InitialAlignmentsTest, AResultOfARegistrationThatBeganBeforeDoesNotEndWhatWasSet) {
  EXPECT_EQ(chosen({}, kCt, 40), "parameters 4");
  set(pose("us", 2.0));
  accept(msg::Alignment::ACCEPTED, 1005.0, 60);
  EXPECT_EQ(chosen({}, kCt, 70), "set 2");
  accept(msg::Alignment::ACCEPTED, 1005.0, 69);  // late
  EXPECT_EQ(chosen({}, kCt, 80), "set 2");
  accept(msg::Alignment::ACCEPTED, 1006.0, 90);
  EXPECT_EQ(chosen({}, kCt, 100), "accepted 6");
}

TEST_F(InitialAlignmentsTest, SetStaysWithThePatientWhenTheProbeMoves) {
  set(pose("us", 2.0));
  us_->pose.T_fixed_us = shifted(1100.0);
  EXPECT_EQ(chosen(), "set -98");
}

TEST_F(InitialAlignmentsTest, SetInTheFixedFrameNeedsNoUltrasound) {
  alignments_.set(pose("patient", 1009.0), {}, []() -> std::shared_ptr<const HeldUltrasound> {
    throw Refusal(Status::NO_ULTRASOUND, "none");
  });
  EXPECT_EQ(chosen(), "set 9");
}

TEST_F(InitialAlignmentsTest, AlignmentOfAnotherCtIsNotUsed) {
  accept(msg::Alignment::ACCEPTED, 1005.0, 20, "ct_of_last_month");
  EXPECT_EQ(chosen(), "parameters 4");
  // Another patient's CT may have a frame of the same name.
  accept(msg::Alignment::ACCEPTED, 1005.0, 20, "ct", kCt + 1);
  EXPECT_EQ(chosen(), "parameters 4");
  accept(msg::Alignment::ACCEPTED, 1005.0, 20);
  EXPECT_EQ(chosen(), "accepted 5");
}

/// A CT that is shown again, after another one, has its alignment again.
TEST_F(InitialAlignmentsTest, SetIsThatOfTheCtThatWasHeldThen) {
  const HeldCt ct = held_ct(kCt);
  set(pose("us", 2.0), identity_of(ct));
  EXPECT_EQ(chosen({}, kCt + 1), "parameters 4");
  EXPECT_EQ(chosen(), "set 2");
  set(pose("us", 7.0), identity_of(ct));
  HeldCt renamed = ct;
  renamed.header.frame_id = "ct_of_last_month";
  EXPECT_EQ(alignments_.choose({}, *us_, renamed, 50)->source, "parameters");
}

TEST_F(InitialAlignmentsTest, IsInForceForTheUltrasoundAndTheCtOfItsResult) {
  const CtIdentity ct("ct", kCt);
  const ::ros::Time of_ultrasound(90.0);
  EXPECT_FALSE(alignments_.is_in_force(of_ultrasound, ct));
  for (const std::uint8_t state : {msg::Alignment::ACCEPTED, msg::Alignment::RESTORED}) {
    accept(state, 1005.0, 20);
    EXPECT_TRUE(alignments_.is_in_force(of_ultrasound, ct));
    EXPECT_FALSE(alignments_.is_in_force(::ros::Time(89.0), ct));
    EXPECT_FALSE(alignments_.is_in_force(::ros::Time(91.0), ct));
    EXPECT_FALSE(alignments_.is_in_force(of_ultrasound, {"ct", kCt + 1}));
  }
  accept(msg::Alignment::NONE, 0.0, 0);
  EXPECT_FALSE(alignments_.is_in_force(of_ultrasound, ct));
}

TEST_F(InitialAlignmentsTest, SetBeforeAnyCtIsThatOfTheFirstOneThatIsRegistered) {
  set(pose("us", 2.0));
  EXPECT_EQ(chosen({}, kCt + 1), "set 2");
  EXPECT_EQ(chosen(), "parameters 4");
  EXPECT_EQ(chosen({}, kCt + 1), "set 2");
}

TEST_F(InitialAlignmentsTest, LandmarksAreAligned) {
  SetRequest request;
  request.type = SetRequest::LANDMARKS;
  request.header.frame_id = "us";
  const std::vector<Vector3d> points_ct = {{0, 0, 0}, {30, 0, 0}, {0, 40, 0}, {0, 0, 50}};
  for (const Vector3d& p : points_ct) {
    request.points_ct.push_back(to_message(p));
    request.points.push_back(to_message(Vector3d(p + Vector3d(12, 0, 0))));
  }
  EXPECT_NEAR(set(request), 0.0, 1e-9);
  EXPECT_EQ(chosen(), "set 12");
  // The points move apart in x: no rigid motion brings both pairs together.
  request.points.resize(3);
  request.points_ct.resize(3);
  request.points[1].x += 0.003;
  EXPECT_GT(set(request), 0.0005);
  EXPECT_LT(set(request), 0.003);
}

TEST_F(InitialAlignmentsTest, BadRequestsAreRefusedAndChangeNothing) {
  set(pose("us", 2.0));
  SetRequest two_points;
  two_points.type = SetRequest::LANDMARKS;
  two_points.header.frame_id = "us";
  two_points.points.resize(2);
  two_points.points_ct.resize(2);
  SetRequest collinear = two_points;
  collinear.points.clear();
  for (int i = 0; i < 4; ++i) collinear.points.push_back(to_message(Vector3d(10.0 * i, 0, 0)));
  collinear.points_ct = collinear.points;
  SetRequest no_rotation = pose("us", 1.0);
  no_rotation.transform.rotation.w = 0.0;
  SetRequest no_type = pose("us", 1.0);
  no_type.type = 0;
  for (const SetRequest& bad : {two_points, collinear, no_rotation, no_type, pose("", 1.0)})
    EXPECT_EQ(code_of([&] { set(bad); }), Status::INVALID_REQUEST);
  EXPECT_EQ(code_of([&] { set(pose("nowhere", 1.0)); }), Status::TF_UNAVAILABLE);
  EXPECT_EQ(chosen(), "set 2");
}

TEST_F(InitialAlignmentsTest, GoalThatIsNoRotationIsRefused) {
  geometry_msgs::TransformStamped goal;
  goal.header.frame_id = "us";
  EXPECT_EQ(code_of([&] { chosen(goal); }), Status::INVALID_REQUEST);
}

}  // namespace
}  // namespace usct::ros_interface
