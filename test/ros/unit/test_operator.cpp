#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/conversions/poses.h"
#include "ros/operator/landmark_pairs.h"
#include "ros/operator/node_watch.h"
#include "ros/operator/operator_state.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using diagnostic_msgs::DiagnosticStatus;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using visualization_msgs::Marker;

msg::Measure measure(const std::string& name, double value) {
  msg::Measure one;
  one.name = name;
  one.value = value;
  return one;
}

msg::RegistrationResult a_result(std::uint64_t id,
                                 std::uint8_t code = msg::StatusCode::REGISTERED) {
  msg::RegistrationResult message;
  message.id = id;
  message.status.code = code;
  message.status.message = "the reason of " + std::to_string(id);
  message.transform.rotation.w = 1.0;
  message.candidates.resize(1);
  message.candidates[0].transform.rotation.w = 1.0;
  message.measures = {measure("wrong_probability", 0.125), measure("expected_error_mm", 1.25)};
  return message;
}

msg::Alignment an_alignment(std::uint8_t state, std::uint64_t id, const std::string& words) {
  msg::Alignment message;
  message.state = state;
  message.result_id = id;
  message.message = words;
  message.expected_error = 0.0025;
  message.policy = "confirm";
  return message;
}

msg::Alignment waits(std::uint64_t id) {
  msg::Alignment message = an_alignment(msg::Alignment::PROPOSED, id, "result waits");
  message.waiting_id = id;
  return message;
}

/// The names of the actions that are allowed, in their order.
std::string allowed(const OperatorState& state) {
  std::string names;
  for (const auto& [action, name] : {std::pair(OperatorAction::kRegister, "register "),
                                     std::pair(OperatorAction::kCancel, "cancel "),
                                     std::pair(OperatorAction::kAccept, "accept "),
                                     std::pair(OperatorAction::kReject, "reject "),
                                     std::pair(OperatorAction::kRevert, "revert ")})
    if (state.may(action)) names += name;
  return names;
}

TEST(OperatorState, AllowsOnlyWhatTheStateAllows) {
  OperatorState state;
  EXPECT_EQ(allowed(state), "register ");
  state.take_proposed(waits(5));
  EXPECT_EQ(allowed(state), "register accept reject ");
  EXPECT_EQ(state.subject_id(), 5U);
  state.take_alignment(an_alignment(msg::Alignment::ACCEPTED, 4, "result 4 is broadcast"));
  EXPECT_EQ(allowed(state), "register accept reject revert ");
  // A result of another CT than the held one: it waits, but tf_publisher proposes nothing.
  msg::Alignment blocked = an_alignment(msg::Alignment::NONE, 0, "");
  blocked.waiting_id = 6;
  state.take_proposed(blocked);
  EXPECT_EQ(allowed(state), "register reject revert ");
  EXPECT_THAT(state.subject().headline, HasSubstr("result 6 waits but cannot be accepted"));
}

TEST(OperatorState, AllowsNoSecondRequestWhileOneWaitsForItsAnswer) {
  OperatorState state;
  state.take_alignment(an_alignment(msg::Alignment::ACCEPTED, 4, ""));
  state.take_proposed(waits(5));
  state.set_requested(OperatorAction::kAccept, true);
  EXPECT_EQ(allowed(state), "register ");
  state.set_requested(OperatorAction::kAccept, false);
  state.set_requested(OperatorAction::kRegister, true);
  EXPECT_EQ(allowed(state), "cancel accept reject revert ");
  state.set_requested(OperatorAction::kCancel, true);
  EXPECT_EQ(allowed(state), "accept reject revert ");
}

TEST(OperatorState, CancelsTheRegistrationOfAnother) {
  OperatorState state;
  state.set_registering(true);
  EXPECT_EQ(allowed(state), "register cancel ");
}

TEST(OperatorState, ShowsWhatWaitsThenWhatWasRefusedThenWhatCounts) {
  OperatorState state;
  EXPECT_EQ(state.subject().standing, PoseStanding::kNone);
  EXPECT_THAT(state.in_force(), HasSubstr("tf_publisher has not been heard"));

  state.take_result(a_result(4));
  state.take_alignment(an_alignment(msg::Alignment::ACCEPTED, 4, "result 4 is broadcast"));
  EXPECT_EQ(state.subject().standing, PoseStanding::kAccepted);
  EXPECT_EQ(state.subject().headline, "ACCEPTED: result 4 is broadcast");
  EXPECT_EQ(state.in_force(), "result 4 is broadcast");

  state.take_result(a_result(5, msg::StatusCode::LOW_CONFIDENCE));
  EXPECT_EQ(state.subject().standing, PoseStanding::kRefused);
  EXPECT_EQ(state.subject().headline, "REFUSED, LOW_CONFIDENCE: the reason of 5");
  EXPECT_THAT(state.subject().evidence, HasSubstr("more than 5 mm off: 0.125"));
  EXPECT_EQ(state.in_force(), "result 4 is broadcast");

  state.take_result(a_result(6));
  state.take_proposed(waits(6));
  EXPECT_EQ(state.subject().standing, PoseStanding::kWaiting);
  EXPECT_THAT(state.subject().headline, AllOf(HasSubstr("WAITING"), HasSubstr("the reason of 6")));
  EXPECT_THAT(state.subject().evidence,
              AllOf(HasSubstr("more than 5 mm off: 0.125"), HasSubstr("1.25 mm")));
}

TEST(OperatorState, SaysWhatIsKnownOfAnAlignmentWhoseResultIsNot) {
  OperatorState state;
  state.take_alignment(an_alignment(msg::Alignment::RESTORED, 0, "restored"));
  EXPECT_THAT(state.subject().headline, HasSubstr("before a restart"));
  EXPECT_EQ(state.subject().evidence, "expected error: 2.50 mm\n");
  EXPECT_EQ(allowed(state), "register revert ");
}

TEST(OperatorState, ACancelledRegistrationChangesNothing) {
  OperatorState state;
  state.take_result(a_result(4));
  state.take_alignment(an_alignment(msg::Alignment::ACCEPTED, 4, "result 4 is broadcast"));
  state.take_result(a_result(5, msg::StatusCode::CANCELLED));
  EXPECT_EQ(state.subject().standing, PoseStanding::kAccepted);
}

TEST(OperatorState, KnowsTheResultsInUseHoweverManyCome) {
  OperatorState state;
  state.take_result(a_result(4));
  state.take_result(a_result(5));
  state.take_alignment(an_alignment(msg::Alignment::ACCEPTED, 4, "result 4 is broadcast"));
  state.take_proposed(waits(5));
  for (std::uint64_t id = 6; id < 40; ++id)
    state.take_result(a_result(id, msg::StatusCode::LOW_CONFIDENCE));
  ASSERT_NE(state.result_in_force(), nullptr);
  EXPECT_EQ(state.result_in_force()->id, 4U);
  EXPECT_THAT(state.subject().evidence, HasSubstr("more than 5 mm off: 0.125"));
}

TEST(OperatorState, CallsNothingAcceptedThatTfDoesNotHave) {
  msg::Alignment accepted = an_alignment(msg::Alignment::ACCEPTED, 4, "result 4 is broadcast");
  accepted.header.frame_id = "patient";
  accepted.ct_frame = "ct";
  accepted.transform = to_message(Eigen::Isometry3d::Identity());
  OperatorState state;
  state.take_result(a_result(4));
  state.take_alignment(accepted);
  TfBuffer tf(::ros::Duration(60.0));
  AlignmentWatch::Clock::time_point wall_now;
  const auto look_up_after = [&](std::chrono::milliseconds passed) {
    wall_now += passed;
    state.look_up(tf, ::ros::Time(100.0), wall_now);
  };
  look_up_after(std::chrono::milliseconds(0));
  look_up_after(AlignmentWatch::kPatience);
  EXPECT_EQ(state.subject().standing, PoseStanding::kNone);
  EXPECT_THAT(state.subject().headline,
              HasSubstr("NO POSE: the accepted alignment is not in force"));
  EXPECT_THAT(state.in_force(), HasSubstr("tf does not connect 'ct' to 'patient'"));
  EXPECT_EQ(state.result_in_force(), nullptr);
  EXPECT_EQ(allowed(state), "register revert ");
  tf.set_transform(
      stamped_transform(::ros::Time(100.0), Eigen::Isometry3d::Identity(), "patient", "ct"),
      "test");
  look_up_after(AlignmentWatch::kPatience);
  EXPECT_EQ(state.subject().headline, "ACCEPTED: result 4 is broadcast");
}

TEST(OperatorState, ShowsTheMessageOfAResultThatItCannotRead) {
  OperatorState state;
  msg::RegistrationResult bad = a_result(7, msg::StatusCode::LOW_CONFIDENCE);
  bad.measures.push_back(measure("no such measure", 1.0));
  state.take_result(bad);
  EXPECT_THAT(state.subject().headline, HasSubstr("the reason of 7"));
  EXPECT_THAT(state.subject().evidence, IsEmpty());
}

diagnostic_msgs::DiagnosticArray said(const std::string& name, const std::string& words,
                                      const std::string& key, const std::string& value) {
  diagnostic_msgs::DiagnosticArray array;
  array.status.resize(1);
  array.status[0].name = name;
  array.status[0].message = words;
  array.status[0].level = DiagnosticStatus::WARN;
  array.status[0].values.resize(1);
  array.status[0].values[0].key = key;
  array.status[0].values[0].value = value;
  return array;
}

TEST(NodeWatch, TellsNodesThatSpeakFromSilentOnes) {
  NodeWatch watch("robot/", {"registration", "tf_publisher"}, 5.0);
  EXPECT_TRUE(watch.is_silent("registration", 0.0));
  EXPECT_FALSE(watch.is_registering());
  // A node of another namespace, and one whose name only begins in the same way.
  watch.take(said("registration: registration", "other", "state", "running: x"), 10.0);
  watch.take(said("robot/registration_2: registration", "other", "state", "running: x"), 10.0);
  EXPECT_FALSE(watch.is_registering());
  watch.take(said("robot/registration: registration", "busy", "state", "running: service"), 10.0);
  EXPECT_TRUE(watch.is_registering());
  watch.take(said("robot/registration: registration", "well", "newest ultrasound", "3 s ago"),
             11.0);
  EXPECT_FALSE(watch.is_registering());

  std::vector<NodeLine> lines = watch.lines(15.0);
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0].text, "well; newest ultrasound: 3 s ago");
  EXPECT_EQ(lines[0].level, DiagnosticStatus::WARN);
  EXPECT_EQ(lines[1].text, "not heard");
  EXPECT_EQ(lines[1].level, DiagnosticStatus::STALE);
  lines = watch.lines(17.0);
  EXPECT_THAT(lines[0].text, AllOf(HasSubstr("silent for 6 s"), HasSubstr("well")));
  EXPECT_EQ(lines[0].level, DiagnosticStatus::STALE);
}

geometry_msgs::Point a_point(double x, double y, double z) {
  geometry_msgs::Point p;
  p.x = x;
  p.y = y;
  p.z = z;
  return p;
}

std::string refusal(LandmarkPairs& pairs, const std::string& frame) {
  try {
    pairs.add(frame, a_point(1, 2, 3));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

LandmarkPairs three_pairs() {
  LandmarkPairs pairs;
  pairs.hold_ct("ct", 7);
  for (const int i : {0, 1, 2}) {
    pairs.add("ct", a_point(i, 0, 0));
    pairs.add("patient", a_point(0, i, 0));
  }
  return pairs;
}

TEST(LandmarkPairs, BecomeARequestOnceTheyAreThree) {
  LandmarkPairs pairs;
  EXPECT_THAT(refusal(pairs, "ct"), HasSubstr("no CT is known"));
  pairs = three_pairs();
  EXPECT_TRUE(pairs.is_ready());
  const auto request = pairs.request();
  EXPECT_EQ(request.type, msg::SetInitialAlignment::Request::LANDMARKS);
  EXPECT_EQ(request.header.frame_id, "patient");
  EXPECT_THAT(request.points_ct, ElementsAre(a_point(0, 0, 0), a_point(1, 0, 0), a_point(2, 0, 0)));
  EXPECT_THAT(request.points, ElementsAre(a_point(0, 0, 0), a_point(0, 1, 0), a_point(0, 2, 0)));

  pairs.add("ct", a_point(9, 9, 9));
  EXPECT_FALSE(pairs.is_ready());
  EXPECT_THROW(pairs.request(), InputError);
  pairs.remove(3);
  pairs.remove(0);
  EXPECT_FALSE(pairs.is_ready());
  EXPECT_THAT(pairs.next_step(), HasSubstr("landmark 3 in the CT"));
}

TEST(LandmarkPairs, TakeEachPointInItsTurn) {
  LandmarkPairs pairs;
  pairs.hold_ct("ct", 7);
  EXPECT_THAT(refusal(pairs, "patient"), HasSubstr("the point in the CT must come first"));
  pairs.add("ct", a_point(1, 0, 0));
  EXPECT_THAT(pairs.next_step(), HasSubstr("landmark 1 in the ultrasound"));
  // A second point in the CT corrects the first.
  pairs.add("ct", a_point(2, 0, 0));
  ASSERT_EQ(pairs.pairs().size(), 1U);
  EXPECT_EQ(pairs.pairs()[0].ct, a_point(2, 0, 0));
  pairs.add("patient", a_point(0, 1, 0));
  pairs.add("ct", a_point(3, 0, 0));
  EXPECT_THAT(refusal(pairs, "elsewhere"), HasSubstr("lie in 'patient'"));
}

TEST(LandmarkPairs, OfAnotherCtAreForgotten) {
  LandmarkPairs pairs = three_pairs();
  pairs.hold_ct("ct", 7);
  EXPECT_EQ(pairs.pairs().size(), 3U);
  pairs.hold_ct("ct", 8);
  EXPECT_THAT(pairs.pairs(), IsEmpty());
}

TEST(LandmarkPairs, AreMarkedInTheirOwnFramesUntilTheyAreRemoved) {
  LandmarkPairs pairs = three_pairs();
  pairs.remove(0);
  // Each point has a sphere and a number.
  const auto markers = pairs.markers().markers;
  ASSERT_EQ(markers.size(), 3U * 4U);
  for (const Marker& marker : markers) {
    EXPECT_EQ(marker.header.frame_id, marker.ns.find("CT") == 0 ? "ct" : "patient");
    EXPECT_EQ(marker.action, marker.id == 3 ? Marker::DELETE : Marker::ADD);
    if (marker.ns == "CT" && marker.id == 1) {
      EXPECT_EQ(marker.pose.position.x, 1.0);
    }
  }
}

}  // namespace
}  // namespace usct::ros_interface
