#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "us_ct_registration/alignment/alignment_decisions.h"

namespace usct {
namespace {

using Code = DecisionAnswer::Code;
using testing::HasSubstr;

constexpr std::uint32_t kCt = 77;
constexpr std::uint32_t kOtherCt = 78;
const CtIdentity kHeld{"ct", kCt};
const CtIdentity kOtherHeld{"ct", kOtherCt};
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kNow = 500 * kSecond;
constexpr std::uint64_t kKept = AlignmentDecisions::kKept;

OfferedResult registered(std::uint64_t id) {
  OfferedResult result;
  result.registered = true;
  result.digest = static_cast<std::uint32_t>(1000 + id);
  Alignment& alignment = result.alignment;
  alignment.us_stamp_ns = kSecond * static_cast<std::int64_t>(100 + id);
  alignment.result_id = id;
  alignment.fixed_frame = "base";
  alignment.ct_frame = "ct";
  alignment.T_fixed_ct = {{0.5 * static_cast<double>(id), 0.0, 0.0},
                          Eigen::Quaterniond::Identity()};
  alignment.expected_error_m = 0.001;
  alignment.ct_crc32 = kCt;
  return result;
}

/// The alignment that is broadcast; fails if there is none.
Alignment broadcast(const AlignmentDecisions& decisions) {
  const AlignmentState state = decisions.state();
  EXPECT_TRUE(state.broadcast) << state.message;
  return state.broadcast.value_or(Alignment());
}

AlignmentDecisions::Options automatic() { return {"", true, true, 3600.0}; }
AlignmentDecisions::Options confirm() { return {"", false, true, 3600.0}; }

StoredAlignment stored_by_another_process() {
  AlignmentDecisions earlier(automatic());
  earlier.offer(registered(4), kNow);
  return earlier.stored();
}

TEST(AlignmentDecisions, NothingCountsAtFirst) {
  EXPECT_FALSE(AlignmentDecisions(confirm()).state().broadcast);
}

TEST(AlignmentDecisions, WhatWaitsIsProposedUntilItIsDecidedOrCannotBeAccepted) {
  AlignmentDecisions decisions(confirm());
  EXPECT_FALSE(decisions.state().proposed);
  decisions.offer(registered(1), kNow);
  ASSERT_TRUE(decisions.state().proposed);
  EXPECT_EQ(decisions.state().proposed->T_fixed_ct, registered(1).alignment.T_fixed_ct);
  decisions.hold_ct(CtSource::kServer, kOtherHeld, kNow);
  EXPECT_FALSE(decisions.state().proposed);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_TRUE(decisions.state().proposed);
  decisions.accept(1, kNow);
  EXPECT_FALSE(decisions.state().proposed);
  decisions.offer(registered(2), kNow);
  EXPECT_EQ(decisions.state().proposed->result_id, 2U);
  decisions.reject(2);
  EXPECT_FALSE(decisions.state().proposed);
}

TEST(AlignmentDecisions, AnAlignmentFromBeforeARestartIsProposedUntilItCounts) {
  AlignmentDecisions::Options options = confirm();
  options.restore_at_once = false;
  AlignmentDecisions decisions(options);
  decisions.restore(stored_by_another_process(), kNow);
  ASSERT_TRUE(decisions.state().proposed);
  EXPECT_TRUE(decisions.state().proposed->restored);
  // A result that waits comes first, as for accept.
  decisions.offer(registered(5), kNow);
  EXPECT_EQ(decisions.state().proposed->result_id, 5U);
  decisions.reject(5);
  EXPECT_TRUE(decisions.state().proposed->restored);
  decisions.accept(kKept, kNow);
  EXPECT_FALSE(decisions.state().proposed);
  EXPECT_TRUE(decisions.state().broadcast);
}

TEST(AlignmentDecisions, AWaitingResultIsReplacedByANewerOneAndCannotBeAcceptedByItsOldId) {
  AlignmentDecisions decisions(confirm());
  EXPECT_EQ(decisions.offer(registered(7), kNow).code, Code::kDone);
  EXPECT_EQ(decisions.offer(registered(8), kNow).code, Code::kDone);
  const DecisionAnswer answer = decisions.accept(7, kNow);
  EXPECT_EQ(answer.code, Code::kInvalidRequest);
  EXPECT_THAT(answer.message, HasSubstr("result 7"));
  EXPECT_THAT(answer.message, HasSubstr("result 8 waits"));
  EXPECT_EQ(decisions.accept(8, kNow).code, Code::kDone);
  EXPECT_EQ(broadcast(decisions).T_fixed_ct.translation_m.x(), 4.0);
  EXPECT_EQ(broadcast(decisions).accepted_ns, kNow);
}

TEST(AlignmentDecisions, WhatIsNoRegistrationChangesNothing) {
  AlignmentDecisions decisions(automatic());
  decisions.offer(registered(1), kNow);
  OfferedResult result = registered(2);
  result.registered = false;
  result.message = "low confidence";
  const DecisionAnswer answer = decisions.offer(result, kNow);
  EXPECT_EQ(answer.code, Code::kNotRegistered);
  EXPECT_THAT(answer.message, HasSubstr("result 2 is no registration: low confidence"));
  EXPECT_EQ(broadcast(decisions).result_id, 1U);
  EXPECT_EQ(decisions.state().waiting_id, 0U);
}

TEST(AlignmentDecisions, WhatMustNotBeBroadcastIsRefusedByName) {
  const std::vector<std::pair<std::string, void (*)(Alignment&)>> cases{
      {"'id' is 0", [](auto& r) { r.result_id = 0; }},
      {"'fixed_frame' is ''", [](auto& r) { r.fixed_frame.clear(); }},
      {"'ct_frame' is '/ct'", [](auto& r) { r.ct_frame = "/ct"; }},
      {"both 'ct'", [](auto& r) { r.fixed_frame = "ct"; }},
      {"the CT hangs on 'base'", [](auto& r) { r.fixed_frame = "table"; }},
      {"quaternion has length 0", [](auto& r) { r.T_fixed_ct.rotation.w() = 0.0; }},
      {"not finite",
       [](auto& r) { r.T_fixed_ct.translation_m.y() = std::numeric_limits<double>::quiet_NaN(); }},
      {"another CT", [](auto& r) { r.ct_crc32 = kOtherCt; }},
      {"'ct_crc32' is 0", [](auto& r) { r.ct_crc32 = 0; }}};
  for (const auto& [reason, damage] : cases) {
    AlignmentDecisions decisions(automatic());
    decisions.hold_ct(CtSource::kServer, kHeld, kNow);
    decisions.offer(registered(1), kNow);
    OfferedResult result = registered(2);
    damage(result.alignment);
    const DecisionAnswer answer = decisions.offer(result, kNow);
    EXPECT_EQ(answer.code, Code::kInvalidResult) << reason;
    EXPECT_THAT(answer.message, HasSubstr(reason));
    EXPECT_EQ(broadcast(decisions).result_id, 1U) << reason;
  }
}

TEST(AlignmentDecisions, OnlyTheConfiguredFixedFrameIsTaken) {
  AlignmentDecisions decisions({"table", true, true, 3600.0});
  EXPECT_THAT(decisions.offer(registered(1), kNow).message,
              HasSubstr("fixed frame is 'base', must be 'table'"));
  EXPECT_THAT(decisions.restore(stored_by_another_process(), kNow).message,
              HasSubstr("'base', must be 'table'"));
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_FALSE(decisions.state().broadcast);
}

TEST(AlignmentDecisions, AfterRevertingToNoneAnotherFixedFrameMayCome) {
  AlignmentDecisions decisions(automatic());
  decisions.offer(registered(1), kNow);
  EXPECT_EQ(decisions.revert().code, Code::kDone);
  OfferedResult result = registered(2);
  result.alignment.fixed_frame = "table";
  EXPECT_EQ(decisions.offer(result, kNow).code, Code::kDone);
  EXPECT_EQ(broadcast(decisions).fixed_frame, "table");
}

TEST(AlignmentDecisions, RevertGoesBackThroughABoundedHistory) {
  AlignmentDecisions decisions(automatic());
  const auto last = static_cast<std::uint64_t>(AlignmentDecisions::kHistory + 5);
  for (std::uint64_t id = 1; id <= last; ++id) decisions.offer(registered(id), kNow);
  EXPECT_EQ(decisions.history(), AlignmentDecisions::kHistory);
  for (std::size_t i = 1; i <= AlignmentDecisions::kHistory; ++i) {
    EXPECT_EQ(decisions.revert().code, Code::kDone);
    EXPECT_EQ(broadcast(decisions).result_id, last - i);
  }
  EXPECT_EQ(decisions.revert().code, Code::kDone);
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_EQ(decisions.revert().code, Code::kNothingToDecide);
}

TEST(AlignmentDecisions, RevertSaysWhatIsInForceAfterIt) {
  AlignmentDecisions decisions(automatic());
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  decisions.offer(registered(1), kNow);
  decisions.offer(registered(2), kNow);
  decisions.hold_ct(CtSource::kServer, kOtherHeld, kNow);
  OfferedResult of_other_ct = registered(3);
  of_other_ct.alignment.ct_crc32 = kOtherCt;
  decisions.offer(of_other_ct, kNow);
  EXPECT_EQ(broadcast(decisions).result_id, 3U);
  const DecisionAnswer answer = decisions.revert();
  EXPECT_EQ(answer.code, Code::kDone);
  EXPECT_EQ(answer.message,
            "result 3 is given up: result 2 is of another CT than the one that is held");
  EXPECT_FALSE(decisions.state().broadcast);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_EQ(decisions.revert().message, "result 2 is given up: result 1 is broadcast");
  EXPECT_EQ(broadcast(decisions).result_id, 1U);
  EXPECT_EQ(decisions.revert().message, "result 1 is given up: nothing is accepted");
}

TEST(AlignmentDecisions, AResultThatComesAgainDoesNotUndoADecision) {
  AlignmentDecisions decisions(automatic());
  OfferedResult result = registered(1);
  decisions.offer(result, kNow);
  decisions.revert();
  EXPECT_EQ(decisions.offer(result, kNow).code, Code::kNothingToDecide);
  EXPECT_FALSE(decisions.state().broadcast);
  // A node that was restarted gives another result the same number.
  result.digest = 5;
  EXPECT_EQ(decisions.offer(result, kNow).code, Code::kDone);
  EXPECT_FALSE(broadcast(decisions).restored);
}

/// A latched topic or a bag that is played again sends it once more.
TEST(AlignmentDecisions, ARejectedResultThatComesAgainDoesNotWaitAgain) {
  AlignmentDecisions decisions(confirm());
  decisions.offer(registered(1), kNow);
  decisions.reject(1);
  EXPECT_EQ(decisions.offer(registered(1), kNow).code, Code::kNothingToDecide);
  EXPECT_EQ(decisions.state().waiting_id, 0U);
  EXPECT_EQ(decisions.stored().decided, registered(1).digest);
}

TEST(AlignmentDecisions, ARestoredAlignmentCountsOnceItsCtIsHeld) {
  AlignmentDecisions decisions(confirm());
  EXPECT_EQ(decisions.restore(stored_by_another_process(), kNow).code, Code::kDone);
  EXPECT_FALSE(decisions.state().broadcast);
  decisions.hold_ct(CtSource::kServer, kOtherHeld, kNow);
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_THAT(decisions.state().message, HasSubstr("another CT"));
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_TRUE(broadcast(decisions).restored);
  EXPECT_EQ(broadcast(decisions).T_fixed_ct.translation_m.x(), 2.0);
  EXPECT_EQ(broadcast(decisions).result_id, 0U);
}

TEST(AlignmentDecisions, WithoutOptionsARestoredAlignmentWaitsForAPerson) {
  AlignmentDecisions decisions({});
  decisions.restore(stored_by_another_process(), kNow);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_EQ(decisions.accept(kKept, kNow + kSecond).code, Code::kDone);
  EXPECT_TRUE(broadcast(decisions).restored);
  EXPECT_EQ(broadcast(decisions).accepted_ns, kNow + kSecond);
}

/// A result may come between the look at the kept alignment and the click that accepts it.
TEST(AlignmentDecisions, WhoeverDecidesAboutTheKeptAlignmentAcceptsNoResultThatHasCome) {
  AlignmentDecisions decisions({});
  decisions.restore(stored_by_another_process(), kNow);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  const DecisionAnswer none = decisions.accept(0, kNow);
  EXPECT_EQ(none.code, Code::kNothingToDecide);
  EXPECT_THAT(none.message, HasSubstr("1 stands for"));
  decisions.offer(registered(5), kNow);
  EXPECT_EQ(decisions.accept(kKept, kNow).code, Code::kDone);
  EXPECT_TRUE(broadcast(decisions).restored);
  EXPECT_EQ(decisions.state().waiting_id, 5U);
  EXPECT_EQ(decisions.accept(0, kNow).code, Code::kDone);
  EXPECT_EQ(broadcast(decisions).result_id, 5U);
  EXPECT_EQ(decisions.accept(kKept, kNow).code, Code::kNothingToDecide);
}

TEST(AlignmentDecisions, AnAlignmentThatIsTooOldIsNotRestored) {
  const std::int64_t latest = kNow + 3600 * kSecond;
  for (const std::int64_t start : {latest + 1, kNow - 1}) {
    AlignmentDecisions decisions(confirm());
    EXPECT_EQ(decisions.restore(stored_by_another_process(), start).code, Code::kNothingToDecide);
    decisions.hold_ct(CtSource::kServer, kHeld, start);
    EXPECT_FALSE(decisions.state().broadcast);
    EXPECT_EQ(decisions.accept(kKept, start).code, Code::kNothingToDecide);
  }
  // It may become too old while it waits.
  AlignmentDecisions decisions(confirm());
  EXPECT_EQ(decisions.restore(stored_by_another_process(), latest).code, Code::kDone);
  decisions.hold_ct(CtSource::kServer, kHeld, latest + 1);
  EXPECT_FALSE(decisions.state().broadcast);
  const DecisionAnswer answer = decisions.accept(kKept, latest + 1);
  EXPECT_EQ(answer.code, Code::kInvalidRequest);
  EXPECT_THAT(answer.message, HasSubstr("restore_max_age = 3600 s"));
  EXPECT_EQ(decisions.accept(kKept, latest).code, Code::kDone);
}

TEST(AlignmentDecisions, AnySourceThatShowsAnotherCtSuspendsAnAlignment) {
  for (const CtSource source : {CtSource::kServer, CtSource::kRegistration}) {
    AlignmentDecisions decisions(automatic());
    decisions.hold_ct(CtSource::kServer, kHeld, kNow);
    decisions.hold_ct(CtSource::kRegistration, kHeld, kNow);
    decisions.offer(registered(1), kNow);
    decisions.hold_ct(source, kOtherHeld, kNow);
    EXPECT_FALSE(decisions.state().broadcast);
    EXPECT_THAT(decisions.offer(registered(2), kNow).message, HasSubstr("another CT"));
    decisions.hold_ct(source, kHeld, kNow);
    EXPECT_EQ(broadcast(decisions).result_id, 1U);
  }
}

/// A CT that was loaded again under another name of its frame: the old name would be broadcast.
TEST(AlignmentDecisions, AnAlignmentUnderAnotherNameOfTheCtsFrameIsNotInForce) {
  for (const CtSource source : {CtSource::kServer, CtSource::kRegistration}) {
    AlignmentDecisions decisions(automatic());
    decisions.restore(stored_by_another_process(), kNow);
    decisions.hold_ct(source, {"ct_2", kCt}, kNow);
    const AlignmentState state = decisions.state();
    EXPECT_FALSE(state.broadcast);
    EXPECT_FALSE(state.proposed);
    EXPECT_EQ(state.message,
              "the alignment from before the restart is of the CT in frame 'ct', but the one that "
              "is held is in frame 'ct_2'");
    const DecisionAnswer accepted = decisions.accept(kKept, kNow);
    EXPECT_EQ(accepted.code, Code::kInvalidRequest);
    EXPECT_THAT(accepted.message, HasSubstr("is held is in frame 'ct_2'"));
    const DecisionAnswer offered = decisions.offer(registered(5), kNow);
    EXPECT_EQ(offered.code, Code::kInvalidResult);
    EXPECT_THAT(offered.message, HasSubstr("it is of the CT in frame 'ct'"));
    decisions.hold_ct(source, kHeld, kNow);
    EXPECT_TRUE(broadcast(decisions).restored);
  }
}

TEST(AlignmentDecisions, AResultThatAPersonMustSeeWaitsAlsoWithoutPersons) {
  AlignmentDecisions decisions(automatic());
  OfferedResult result = registered(1);
  result.ask_because = "it is old";
  const DecisionAnswer answer = decisions.offer(result, kNow);
  EXPECT_EQ(answer.code, Code::kDone);
  EXPECT_THAT(answer.message, HasSubstr("waits for accept or reject: it is old"));
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_EQ(decisions.state().waiting_id, 1U);
  EXPECT_EQ(decisions.accept(1, kNow).code, Code::kDone);
  EXPECT_EQ(broadcast(decisions).result_id, 1U);
}

TEST(AlignmentDecisions, ASuspendedAlignmentComesBackOnlyByAPerson) {
  AlignmentDecisions decisions(automatic());
  decisions.offer(registered(1), kNow);
  decisions.suspend("two parents");
  EXPECT_TRUE(decisions.state().is_suspended);
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_THAT(decisions.state().message, HasSubstr("result 1 is suspended: two parents"));
  EXPECT_THAT(decisions.offer(registered(2), kNow).message, HasSubstr("waits"));
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_EQ(decisions.reject(2).code, Code::kDone);
  EXPECT_EQ(decisions.accept(kKept, kNow).code, Code::kDone);
  EXPECT_FALSE(decisions.state().is_suspended);
  EXPECT_EQ(broadcast(decisions).result_id, 1U);
  decisions.suspend("two parents");
  decisions.offer(registered(3), kNow);
  EXPECT_EQ(decisions.accept(3, kNow).code, Code::kDone);
  EXPECT_EQ(broadcast(decisions).result_id, 3U);
}

/// A restored alignment has no number of a result, and 0 stands for the result that waits alone.
TEST(AlignmentDecisions, ZeroTakesUpNoSuspendedAlignmentFromBeforeARestart) {
  AlignmentDecisions decisions(confirm());
  decisions.restore(stored_by_another_process(), kNow);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  decisions.suspend("two parents");
  const DecisionAnswer answer = decisions.accept(0, kNow);
  EXPECT_EQ(answer.code, Code::kNothingToDecide);
  EXPECT_THAT(answer.message, HasSubstr("1 stands for the alignment from before the restart"));
  EXPECT_TRUE(decisions.state().is_suspended);
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_EQ(decisions.accept(kKept, kNow).code, Code::kDone);
  EXPECT_TRUE(broadcast(decisions).restored);
}

TEST(AlignmentDecisions, ARestartDoesNotTakeUpASuspendedAlignment) {
  AlignmentDecisions earlier(automatic());
  earlier.offer(registered(4), kNow);
  earlier.suspend("two parents");
  AlignmentDecisions decisions(automatic());
  decisions.restore(earlier.stored(), kNow);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_THAT(decisions.state().message, HasSubstr("is suspended: two parents"));
  EXPECT_THAT(decisions.offer(registered(5), kNow).message, HasSubstr("waits"));
  EXPECT_EQ(decisions.reject(5).code, Code::kDone);
  EXPECT_EQ(decisions.accept(kKept, kNow).code, Code::kDone);
  EXPECT_TRUE(broadcast(decisions).restored);
  EXPECT_EQ(decisions.stored().suspended_because, "");
}

TEST(AlignmentDecisions, ASuspendedAlignmentFromBeforeARestartIsGivenUpWithItsSuspension) {
  AlignmentDecisions earlier(automatic());
  earlier.offer(registered(4), kNow);
  earlier.suspend("two parents");
  AlignmentDecisions::Options by_a_person = automatic();
  by_a_person.restore_at_once = false;
  AlignmentDecisions decisions(by_a_person);
  decisions.restore(earlier.stored(), kNow);
  EXPECT_EQ(decisions.reject(kKept).code, Code::kDone);
  EXPECT_FALSE(decisions.state().is_suspended);
  decisions.offer(registered(5), kNow);
  EXPECT_EQ(broadcast(decisions).result_id, 5U);
}

TEST(AlignmentDecisions, ASuspendedAlignmentIsNotRejectedButReverted) {
  AlignmentDecisions decisions(automatic());
  decisions.offer(registered(1), kNow);
  decisions.suspend("two parents");
  const DecisionAnswer answer = decisions.reject(kKept);
  EXPECT_EQ(answer.code, Code::kNothingToDecide);
  EXPECT_THAT(answer.message, HasSubstr("result 1 cannot be rejected"));
  EXPECT_THAT(answer.message, HasSubstr("is suspended; revert gives it up"));
  EXPECT_TRUE(decisions.state().is_suspended);
  EXPECT_EQ(decisions.revert().code, Code::kDone);
  EXPECT_THAT(decisions.reject(kKept).message, HasSubstr("none is suspended"));
}

TEST(AlignmentDecisions, ASuspendedAlignmentOfAnotherCtCannotBeAccepted) {
  AlignmentDecisions decisions(automatic());
  decisions.offer(registered(1), kNow);
  decisions.suspend("two parents");
  decisions.hold_ct(CtSource::kServer, kOtherHeld, kNow);
  const DecisionAnswer answer = decisions.accept(kKept, kNow);
  EXPECT_EQ(answer.code, Code::kInvalidRequest);
  EXPECT_THAT(answer.message, HasSubstr("result 1 cannot be accepted: it is of another CT"));
  EXPECT_TRUE(decisions.state().is_suspended);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_EQ(decisions.accept(kKept, kNow).code, Code::kDone);
  EXPECT_EQ(broadcast(decisions).result_id, 1U);
}

TEST(AlignmentDecisions, RevertingDoesNotLiftASuspensionUnlessNothingIsLeft) {
  AlignmentDecisions decisions(automatic());
  decisions.offer(registered(1), kNow);
  decisions.offer(registered(2), kNow);
  decisions.suspend("two parents");
  EXPECT_EQ(decisions.revert().message, "result 2 is given up: result 1 is suspended: two parents");
  EXPECT_TRUE(decisions.state().is_suspended);
  EXPECT_FALSE(decisions.state().broadcast);
  EXPECT_EQ(decisions.revert().code, Code::kDone);
  EXPECT_FALSE(decisions.state().is_suspended);
}

TEST(AlignmentDecisions, ARestoredAlignmentThatNeverCountedIsNothingToGoBackToAndBlocksNothing) {
  AlignmentDecisions decisions(automatic());
  decisions.restore(stored_by_another_process(), kNow);
  OfferedResult result = registered(9);
  result.alignment.fixed_frame = "table";
  EXPECT_EQ(decisions.offer(result, kNow).code, Code::kDone);
  EXPECT_EQ(broadcast(decisions).fixed_frame, "table");
  EXPECT_EQ(decisions.revert().code, Code::kDone);
  EXPECT_FALSE(decisions.state().broadcast);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_FALSE(decisions.state().broadcast);
}

TEST(AlignmentDecisions, ARestoredAlignmentCanBeRejected) {
  AlignmentDecisions decisions({"", true, false, 3600.0});
  decisions.restore(stored_by_another_process(), kNow);
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_FALSE(decisions.state().broadcast) << "it waits for a person";
  EXPECT_EQ(decisions.reject(kKept).code, Code::kDone);
  EXPECT_FALSE(decisions.stored().alignment);
  EXPECT_EQ(decisions.accept(kKept, kNow).code, Code::kNothingToDecide);
}

TEST(AlignmentDecisions, AWaitingResultIsJudgedAgainWhenItIsAccepted) {
  AlignmentDecisions decisions(confirm());
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  decisions.offer(registered(1), kNow);
  decisions.hold_ct(CtSource::kServer, kOtherHeld, kNow);
  const DecisionAnswer answer = decisions.accept(1, kNow);
  EXPECT_EQ(answer.code, Code::kInvalidRequest);
  EXPECT_THAT(answer.message, HasSubstr("another CT"));
  decisions.hold_ct(CtSource::kServer, kHeld, kNow);
  EXPECT_EQ(decisions.accept(1, kNow).code, Code::kDone);
}

}  // namespace
}  // namespace usct
