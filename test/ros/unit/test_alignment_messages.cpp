#include <gtest/gtest.h>

#include <cmath>

#include "ros/conversions/alignment.h"
#include "ros/conversions/poses.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;

msg::RegistrationResult registered() {
  msg::RegistrationResult result;
  result.header.stamp = ::ros::Time(101, 7);
  result.id = 3;
  result.status.code = Code::REGISTERED;
  result.fixed_frame = "base";
  result.ct_frame = "ct";
  result.fixed_transform.translation.y = -1.0 / 3.0;
  result.fixed_transform.rotation.w = 0.6;
  result.fixed_transform.rotation.z = -0.8;
  result.expected_error = 0.001;
  result.ct_crc32 = 77;
  return result;
}

TEST(AlignmentMessages, AnAcceptedResultIsBroadcastBitByBit) {
  AlignmentDecisions decisions({"", true, true, 3600.0});
  const msg::RegistrationResult result = registered();
  const msg::StatusCode answer = to_message(decisions.offer(from_message(result), 500));
  EXPECT_EQ(answer.code, Code::OK) << answer.message;
  const msg::Alignment alignment = to_message(decisions.state());
  EXPECT_EQ(alignment.state, msg::Alignment::ACCEPTED);
  EXPECT_EQ(alignment.header.stamp, result.header.stamp);
  EXPECT_EQ(alignment.header.frame_id, "base");
  EXPECT_EQ(alignment.ct_frame, "ct");
  EXPECT_EQ(alignment.transform, result.fixed_transform);
  EXPECT_EQ(alignment.result_id, 3u);
  EXPECT_EQ(alignment.ct_crc32, 77u);
  EXPECT_EQ(alignment.accepted, ::ros::Time(0, 500));
  EXPECT_EQ(alignment.expected_error, 0.001);
}

TEST(AlignmentMessages, NothingIsBroadcastAtFirst) {
  const msg::Alignment alignment = to_message(AlignmentState());
  EXPECT_EQ(alignment.state, msg::Alignment::NONE);
  EXPECT_EQ(alignment.transform.rotation.w, 0.0);
  EXPECT_TRUE(std::isnan(alignment.expected_error));
  EXPECT_FALSE(T_fixed_ct_from(alignment));
}

TEST(AlignmentMessages, WhatWaitsIsProposedAndNotBroadcast) {
  AlignmentDecisions decisions({"", false, true, 3600.0});
  EXPECT_EQ(to_proposed_message(decisions.state()).state, msg::Alignment::NONE);
  const msg::RegistrationResult result = registered();
  decisions.offer(from_message(result), 500);
  EXPECT_EQ(to_message(decisions.state()).state, msg::Alignment::NONE);
  const msg::Alignment proposed = to_proposed_message(decisions.state());
  EXPECT_EQ(proposed.state, msg::Alignment::PROPOSED);
  EXPECT_EQ(proposed.header.frame_id, "base");
  EXPECT_EQ(proposed.transform, result.fixed_transform);
  EXPECT_EQ(proposed.result_id, 3u);
  EXPECT_EQ(proposed.waiting_id, 3u);
  EXPECT_EQ(proposed.ct_crc32, 77u);
  EXPECT_EQ(proposed.expected_error, 0.001);
  decisions.accept(3, 600);
  const msg::Alignment none = to_proposed_message(decisions.state());
  EXPECT_EQ(none.state, msg::Alignment::NONE);
  EXPECT_TRUE(std::isnan(none.expected_error));
}

/// In Slicer nothing but the message says by which number it is accepted.
TEST(AlignmentMessages, WhatWaitsIsNamedWithTheNumberByWhichItIsAccepted) {
  AlignmentDecisions earlier({"", true, false, 3600.0});
  const msg::RegistrationResult result = registered();
  earlier.offer(from_message(result), 500);
  AlignmentDecisions decisions({});
  decisions.restore(earlier.stored(), 600);
  EXPECT_EQ(to_proposed_message(decisions.state()).message,
            "the alignment from before the restart (1) waits for accept or reject");
  EXPECT_TRUE(decisions.accept(1, 700).is_done());
  msg::RegistrationResult newer = registered();
  newer.id = 4;
  decisions.offer(from_message(newer), 800);
  EXPECT_EQ(to_proposed_message(decisions.state()).message, "result 4 waits for accept or reject");
}

TEST(AlignmentMessages, WhatIsNoRegistrationIsNotOffered) {
  for (const std::uint8_t code :
       {Code::FAILED, Code::OK, Code::LOW_CONFIDENCE, Code::NO_OVERLAP, Code::CANCELLED}) {
    msg::RegistrationResult result = registered();
    result.status.code = code;
    EXPECT_FALSE(from_message(result).registered) << int{code};
  }
}

TEST(AlignmentMessages, TheDigestTellsResultsApartHoweverOftenTheyAreSent) {
  msg::RegistrationResult result = registered();
  const std::uint32_t digest = from_message(result).digest;
  result.header.seq = 9;
  EXPECT_EQ(from_message(result).digest, digest);
  // A node that was restarted gives another registration the same number.
  result.durations.resize(1);
  EXPECT_NE(from_message(result).digest, digest);
}

/// The pose of the CT's origin (m), and the rotation vector from `start` to `T`.
Eigen::Matrix<double, 6, 1> moved(const Eigen::Isometry3d& T, const Eigen::Isometry3d& start) {
  const Eigen::AngleAxisd turn(T.linear() * start.linear().transpose());
  Eigen::Matrix<double, 6, 1> pose;
  pose << T.translation(), turn.angle() * turn.axis();
  return pose;
}

TEST(AlignmentMessages, TheCovarianceIsThatOfThePoseInTheFixedFrame) {
  using Eigen::AngleAxisd;
  using Eigen::Isometry3d;
  using Eigen::Vector3d;
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  const Isometry3d T_fixed_us =
      Eigen::Translation3d(0.3, -1.2, 0.7) * AngleAxisd(1.1, Vector3d(1.0, -2.0, 0.5).normalized());
  const Isometry3d T_us_ct = Eigen::Translation3d(-0.05, 0.21, 0.13) *
                             AngleAxisd(-2.0, Vector3d(0.2, 1.0, 0.7).normalized());
  Matrix6d root;
  for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = 1e-3 * std::sin(1.0 + 7.0 * i);
  const Matrix6d in_us = root * root.transpose();

  // The definition, by differences: a small motion d about the origin of the ultrasound's frame
  // follows T_us_ct.
  const Isometry3d start = T_fixed_us * T_us_ct;
  constexpr double kSmall = 1e-6;
  Matrix6d jacobian;
  for (int i = 0; i < 6; ++i) {
    Isometry3d motion = Isometry3d::Identity();
    if (i < 3)
      motion.translation()[i] = kSmall;
    else
      motion.linear() = AngleAxisd(kSmall, Vector3d::Unit(i - 3)).toRotationMatrix();
    jacobian.col(i) = (moved(T_fixed_us * motion * T_us_ct, start) - moved(start, start)) / kSmall;
  }
  const Matrix6d expected = jacobian * in_us * jacobian.transpose();

  msg::RegistrationResult result = registered();
  Isometry3d us_ct_mm = T_us_ct;
  us_ct_mm.translation() *= kMmPerM;
  Isometry3d fixed_ct_mm = start;
  fixed_ct_mm.translation() *= kMmPerM;
  result.transform = to_message(us_ct_mm);
  result.fixed_transform = to_message(fixed_ct_mm);
  for (int i = 0; i < 36; ++i) result.covariance[static_cast<std::size_t>(i)] = in_us(i / 6, i % 6);
  const auto pose = to_pose_message(from_message(result).alignment);
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->header.frame_id, "base");
  EXPECT_EQ(pose->header.stamp, result.header.stamp);
  EXPECT_EQ(pose->pose.pose.position.y, result.fixed_transform.translation.y);
  EXPECT_EQ(pose->pose.pose.orientation, result.fixed_transform.rotation);
  for (int i = 0; i < 36; ++i)
    EXPECT_NEAR(pose->pose.covariance[static_cast<std::size_t>(i)], expected(i / 6, i % 6),
                1e-5 * expected.norm())
        << i;
}

TEST(AlignmentMessages, AnUnknownCovarianceIsNoPose) {
  const Alignment alignment = from_message(registered()).alignment;
  EXPECT_FALSE(to_pose_message(alignment));
  const geometry_msgs::TransformStamped transform = to_transform_message(alignment);
  EXPECT_EQ(transform.header.frame_id, "base");
  EXPECT_EQ(transform.child_frame_id, "ct");
  EXPECT_EQ(transform.transform, registered().fixed_transform);
}

}  // namespace
}  // namespace usct::ros_interface
