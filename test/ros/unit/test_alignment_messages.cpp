#include <gtest/gtest.h>

#include <cmath>

#include "ros/conversions/alignment.h"

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
  AlignmentDecisions decisions({"", true, true});
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

}  // namespace
}  // namespace usct::ros_interface
