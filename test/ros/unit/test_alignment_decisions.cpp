#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "ros/alignment_decisions.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;
using msg::Alignment;
using testing::HasSubstr;

constexpr std::uint32_t kCt = 77;
constexpr std::uint32_t kOtherCt = 78;
const ::ros::Time kNow(500);

msg::RegistrationResult registered(std::uint32_t id) {
  msg::RegistrationResult result;
  result.header.stamp = ::ros::Time(100 + id);
  result.id = id;
  result.status.code = Code::REGISTERED;
  result.fixed_frame = "base";
  result.ct_frame = "ct";
  result.fixed_transform.translation.x = 0.5 * id;
  result.fixed_transform.rotation.w = 1.0;
  result.expected_error = 0.001;
  result.ct_crc32 = kCt;
  return result;
}

AlignmentDecisions::Options automatic() { return {"", true, true}; }
AlignmentDecisions::Options confirm() { return {"", false, true}; }

StoredAlignment stored_by_another_process() {
  AlignmentDecisions earlier(automatic());
  earlier.offer(registered(4), kNow);
  return earlier.stored();
}

TEST(AlignmentDecisions, NothingCountsAtFirst) {
  const Alignment alignment = AlignmentDecisions(confirm()).alignment();
  EXPECT_EQ(alignment.state, Alignment::NONE);
  EXPECT_EQ(alignment.transform.rotation.w, 0.0);
  EXPECT_TRUE(std::isnan(alignment.expected_error));
}

TEST(AlignmentDecisions, AWaitingResultIsReplacedByANewerOneAndCannotBeAcceptedByItsOldId) {
  AlignmentDecisions decisions(confirm());
  EXPECT_EQ(decisions.offer(registered(1), kNow).code, Code::OK);
  EXPECT_EQ(decisions.offer(registered(2), kNow).code, Code::OK);
  const msg::StatusCode answer = decisions.accept(1, kNow);
  EXPECT_EQ(answer.code, Code::INVALID_REQUEST);
  EXPECT_THAT(answer.message, HasSubstr("result 1"));
  EXPECT_THAT(answer.message, HasSubstr("result 2 waits"));
  EXPECT_EQ(decisions.accept(2, kNow).code, Code::OK);
  EXPECT_EQ(decisions.alignment().transform.translation.x, 1.0);
  EXPECT_EQ(decisions.alignment().accepted, kNow);
}

TEST(AlignmentDecisions, WhatIsNoRegistrationChangesNothing) {
  AlignmentDecisions decisions(automatic());
  decisions.offer(registered(1), kNow);
  for (const std::uint8_t code :
       {Code::FAILED, Code::OK, Code::LOW_CONFIDENCE, Code::NO_OVERLAP, Code::CANCELLED}) {
    msg::RegistrationResult result = registered(2);
    result.status.code = code;
    decisions.offer(result, kNow);
    EXPECT_EQ(decisions.alignment().result_id, 1U) << int{code};
    EXPECT_EQ(decisions.alignment().waiting_id, 0U) << int{code};
  }
}

TEST(AlignmentDecisions, WhatMustNotReachTfIsRefusedByName) {
  const std::vector<std::pair<std::string, void (*)(msg::RegistrationResult&)>> cases{
      {"'id' is 0", [](auto& r) { r.id = 0; }},
      {"'fixed_frame' is ''", [](auto& r) { r.fixed_frame.clear(); }},
      {"'ct_frame' is '/ct'", [](auto& r) { r.ct_frame = "/ct"; }},
      {"both 'ct'", [](auto& r) { r.fixed_frame = "ct"; }},
      {"the CT hangs on 'base'", [](auto& r) { r.fixed_frame = "table"; }},
      {"quaternion has length 0", [](auto& r) { r.fixed_transform.rotation.w = 0.0; }},
      {"not finite",
       [](auto& r) { r.fixed_transform.translation.y = std::numeric_limits<double>::quiet_NaN(); }},
      {"another CT", [](auto& r) { r.ct_crc32 = kOtherCt; }}};
  for (const auto& [reason, damage] : cases) {
    AlignmentDecisions decisions(automatic());
    decisions.hold_ct(kCt);
    decisions.offer(registered(1), kNow);
    msg::RegistrationResult result = registered(2);
    damage(result);
    const msg::StatusCode answer = decisions.offer(result, kNow);
    EXPECT_EQ(answer.code, Code::INVALID_MESSAGE) << reason;
    EXPECT_THAT(answer.message, HasSubstr(reason));
    EXPECT_EQ(decisions.alignment().result_id, 1U) << reason;
  }
}

TEST(AlignmentDecisions, OnlyTheConfiguredFixedFrameIsTaken) {
  AlignmentDecisions decisions({"table", true, true});
  EXPECT_THAT(decisions.offer(registered(1), kNow).message,
              HasSubstr("fixed frame is 'base', must be 'table'"));
  EXPECT_THAT(decisions.restore(stored_by_another_process()).message,
              HasSubstr("'base', must be 'table'"));
  decisions.hold_ct(kCt);
  EXPECT_EQ(decisions.alignment().state, Alignment::NONE);
}

TEST(AlignmentDecisions, AfterRevertingToNoneAnotherFixedFrameMayCome) {
  AlignmentDecisions decisions(automatic());
  decisions.offer(registered(1), kNow);
  EXPECT_EQ(decisions.revert().code, Code::OK);
  msg::RegistrationResult result = registered(2);
  result.fixed_frame = "table";
  EXPECT_EQ(decisions.offer(result, kNow).code, Code::OK);
  EXPECT_EQ(decisions.alignment().header.frame_id, "table");
}

TEST(AlignmentDecisions, RevertGoesBackThroughABoundedHistory) {
  AlignmentDecisions decisions(automatic());
  const auto last = static_cast<std::uint32_t>(AlignmentDecisions::kHistory + 5);
  for (std::uint32_t id = 1; id <= last; ++id) decisions.offer(registered(id), kNow);
  EXPECT_EQ(decisions.history(), AlignmentDecisions::kHistory);
  for (std::size_t i = 1; i <= AlignmentDecisions::kHistory; ++i) {
    EXPECT_EQ(decisions.revert().code, Code::OK);
    EXPECT_EQ(decisions.alignment().result_id, last - i);
  }
  EXPECT_EQ(decisions.revert().code, Code::OK);
  EXPECT_EQ(decisions.alignment().state, Alignment::NONE);
  EXPECT_EQ(decisions.revert().code, Code::NOTHING_TO_DECIDE);
}

TEST(AlignmentDecisions, AMessageThatComesAgainDoesNotUndoADecision) {
  AlignmentDecisions decisions(automatic());
  msg::RegistrationResult result = registered(1);
  decisions.offer(result, kNow);
  decisions.revert();
  result.header.seq = 9;
  EXPECT_EQ(decisions.offer(result, kNow).code, Code::NOTHING_TO_DECIDE);
  EXPECT_EQ(decisions.alignment().state, Alignment::NONE);
  // Another registration with the same number (of a restarted node) is another message.
  result.durations.resize(1);
  EXPECT_EQ(decisions.offer(result, kNow).code, Code::OK);
  EXPECT_EQ(decisions.alignment().state, Alignment::ACCEPTED);
}

TEST(AlignmentDecisions, ARestoredAlignmentCountsOnceItsCtIsHeld) {
  AlignmentDecisions decisions(confirm());
  EXPECT_EQ(decisions.restore(stored_by_another_process()).code, Code::OK);
  EXPECT_EQ(decisions.alignment().state, Alignment::NONE);
  decisions.hold_ct(kOtherCt);
  EXPECT_EQ(decisions.alignment().state, Alignment::NONE);
  EXPECT_THAT(decisions.alignment().message, HasSubstr("another CT"));
  decisions.hold_ct(kCt);
  EXPECT_EQ(decisions.alignment().state, Alignment::RESTORED);
  EXPECT_EQ(decisions.alignment().transform.translation.x, 2.0);
  EXPECT_EQ(decisions.alignment().result_id, 0U);
}

TEST(AlignmentDecisions, ARestoredAlignmentOfAnUnknownCtWaitsForAPerson) {
  StoredAlignment stored = stored_by_another_process();
  stored.alignment->ct_crc32 = 0;
  AlignmentDecisions decisions(confirm());
  decisions.restore(stored);
  decisions.hold_ct(kCt);
  EXPECT_EQ(decisions.alignment().state, Alignment::NONE);
  EXPECT_EQ(decisions.accept(0, kNow).code, Code::OK);
  EXPECT_EQ(decisions.alignment().state, Alignment::RESTORED);
}

TEST(AlignmentDecisions, ARestoredAlignmentThatNeverCountedIsNothingToGoBackToAndBlocksNothing) {
  AlignmentDecisions decisions(automatic());
  decisions.restore(stored_by_another_process());
  msg::RegistrationResult result = registered(9);
  result.fixed_frame = "table";
  EXPECT_EQ(decisions.offer(result, kNow).code, Code::OK);
  EXPECT_EQ(decisions.alignment().header.frame_id, "table");
  EXPECT_EQ(decisions.revert().code, Code::OK);
  EXPECT_EQ(decisions.alignment().state, Alignment::NONE);
}

TEST(AlignmentDecisions, ARestoredAlignmentCanBeRejected) {
  AlignmentDecisions decisions({"", true, false});
  decisions.restore(stored_by_another_process());
  decisions.hold_ct(kCt);
  EXPECT_EQ(decisions.alignment().state, Alignment::NONE) << "it waits for a person";
  EXPECT_EQ(decisions.reject(0).code, Code::OK);
  EXPECT_FALSE(decisions.stored().alignment);
  EXPECT_EQ(decisions.accept(0, kNow).code, Code::NOTHING_TO_DECIDE);
}

TEST(AlignmentDecisions, AWaitingResultIsJudgedAgainWhenItIsAccepted) {
  AlignmentDecisions decisions(confirm());
  decisions.hold_ct(kCt);
  decisions.offer(registered(1), kNow);
  decisions.hold_ct(kOtherCt);
  const msg::StatusCode answer = decisions.accept(1, kNow);
  EXPECT_EQ(answer.code, Code::INVALID_REQUEST);
  EXPECT_THAT(answer.message, HasSubstr("another CT"));
  decisions.hold_ct(kCt);
  EXPECT_EQ(decisions.accept(1, kNow).code, Code::OK);
}

}  // namespace
}  // namespace usct::ros_interface
