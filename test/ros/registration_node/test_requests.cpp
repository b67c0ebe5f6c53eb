#include <ros/package.h>
#include <rosgraph_msgs/Log.h>
#include <std_msgs/String.h>
#include <topic_tools/shape_shifter.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/Cancel.h>
#include <us_ct_registration/CtInfo.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <future>
#include <memory>
#include <mutex>
#include <sstream>

#include "registration_client.h"

namespace usct::ros_interface {
namespace {

using Eigen::Vector3d;
using testing::AllOf;
using testing::HasSubstr;

/// Latches a message whose type has the right name and other fields.
::ros::Publisher publish_other_definition(::ros::NodeHandle& node, const std::string& topic,
                                          const std::string& datatype) {
  std_msgs::String text;
  text.data = "something else";
  std::vector<std::uint8_t> bytes(::ros::serialization::serializationLength(text));
  ::ros::serialization::OStream out(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ::ros::serialization::serialize(out, text);
  topic_tools::ShapeShifter other;
  other.morph("0123456789abcdef0123456789abcdef", datatype, "string data\n", "1");
  ::ros::serialization::IStream in(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  other.read(in);
  ::ros::Publisher publisher = other.advertise(node, topic, 1, true);
  publisher.publish(other);
  return publisher;
}

TEST(Registration, SaysWhyNothingArrived) {
  RegistrationClient client("empty");
  EXPECT_THAT(client.call_until_code(Status::NO_CT).status.message,
              HasSubstr("'/empty/ct/volume' has no publisher"));
  {
    const ::ros::Publisher other =
        publish_other_definition(client.node, "ct/volume", "us_ct_registration/CtVolume");
    client.call_until([](const Result& result) {
      return result.status.message.find("0123456789abcdef") != std::string::npos;
    });
  }
  CtVolume ct;
  ct.grid.size = {8, 8, 8};
  ct.grid.spacing_mm = {1.0, 1.0, 1.0};
  ct.voxels.assign(512, 0);
  client.send_ct(ct, 1, ::ros::Time::now());
  EXPECT_THAT(client.call_until_code(Status::NO_ULTRASOUND).status.message,
              HasSubstr("'/empty/us/volume' has no publisher"));
  {
    const ::ros::Publisher text = client.node.advertise<std_msgs::String>("us/volume", 1, true);
    client.call_until([](const Result& result) {
      return result.status.message.find("std_msgs/String") != std::string::npos &&
             result.status.message.find("us_ct_registration/PreScanVolume") != std::string::npos;
    });
  }
  for (const Result& result : client.published()) {
    EXPECT_TRUE(is_zero(result.transform));
    EXPECT_TRUE(is_zero(result.fixed_transform));
    EXPECT_TRUE(std::isnan(result.similarity));
    EXPECT_TRUE(std::isnan(result.wrong_probability));
    EXPECT_TRUE(std::isnan(result.expected_error));
    EXPECT_TRUE(std::isnan(result.error_bound));
  }
}

TEST(Registration, EmptyCallsFromEverywhereRegister) {
  RegistrationClient client("plain");
  provide_agar(client, 1);
  const Result result = client.call_until_code(Status::REGISTERED);
  EXPECT_LT(error_mm(result), kGoodMm);
  EXPECT_EQ(result.header.frame_id, "us");
  EXPECT_EQ(result.ct_frame, "ct");
  EXPECT_EQ(result.ct_revision, 1U);
  EXPECT_EQ(result.ct_crc32, to_message(agar().ct, header("ct", ::ros::Time(1.0)), 1).crc32);
  EXPECT_EQ(result.us_stamp, result.header.stamp);
  EXPECT_EQ(result.initial_alignment, "set");
  EXPECT_EQ(result.preset, "phantom with options");
  EXPECT_EQ(result.fixed_frame, "us");
  EXPECT_EQ(result.fixed_transform, result.transform);
  EXPECT_GE(result.wrong_probability, 0.0);
  EXPECT_LE(result.wrong_probability, 0.3) << "the limit of the gate";
  EXPECT_GT(result.expected_error, 0.0);
  EXPECT_GT(result.error_bound, result.expected_error);
  EXPECT_TRUE(eventually(
      [&] { return !client.published().empty() && client.published().back().id == result.id; }));

  const std::string shell = output_of("rosservice call /plain/register");
  EXPECT_THAT(shell, AllOf(HasSubstr("success: True"), HasSubstr("exit status 0")));

  const std::string script =
      ::ros::package::getPath("us_ct_registration") + "/test/ros/call_register.py /plain/register";
  std::istringstream printed(output_of("/usr/bin/python3 " + script));
  int code = 0;
  Vector3d translation_m;
  printed >> code >> translation_m.x() >> translation_m.y() >> translation_m.z();
  EXPECT_EQ(code, Status::REGISTERED) << printed.str();
  // A call from the shell gives the same result.
  const auto& t = result.transform.translation;
  EXPECT_LT((translation_m - Vector3d(t.x, t.y, t.z)).norm(), 1e-9);
}

TEST(Registration, IdsAreTimesAndRiseAlsoWithRefusals) {
  RegistrationClient client("plain");
  const auto now_ms = [] { return ::ros::WallTime::now().toNSec() / 1'000'000; };
  const std::uint64_t before = now_ms();
  const std::uint64_t first = client.call().id;
  EXPECT_GE(first, before);
  EXPECT_LE(first, now_ms());
  EXPECT_GT(client.call().id, first);
}

TEST(Registration, SaysWhatToDoNextAndLogsOneLine) {
  RegistrationClient client("plain");
  provide_agar(client, 1);
  EXPECT_THAT(client.call().status.message, HasSubstr("no tf_publisher"));
  std::mutex mutex;
  std::vector<std::string> lines;
  const ::ros::Subscriber log = client.node.subscribe<rosgraph_msgs::Log>(
      "/rosout", 100, [&](const rosgraph_msgs::Log::ConstPtr& line) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (line->name == "/plain/registration") lines.push_back(line->msg);
      });
  ASSERT_TRUE(eventually([&] { return log.getNumPublishers() >= 5; }));
  ::ros::Publisher alignments =
      client.node.advertise<msg::Alignment>("registration/alignment", 1, true);
  for (const auto& [policy, expected] :
       {std::pair("confirm", "rosservice call /plain/registration/accept "),
        std::pair("auto", "tf_publisher decides by itself")}) {
    msg::Alignment alignment;
    alignment.policy = policy;
    alignments.publish(alignment);
    const Result result = client.call_until([&, text = expected](const Result& found) {
      return found.status.message.find(text) != std::string::npos;
    });
    EXPECT_EQ(result.status.code, Status::REGISTERED);
    const std::string id = std::to_string(result.id);
    if (policy == std::string("confirm")) {
      EXPECT_THAT(result.status.message, HasSubstr("accept " + id));
    }
    EXPECT_TRUE(eventually([&] {
      const std::lock_guard<std::mutex> lock(mutex);
      return std::count_if(lines.begin(), lines.end(), [&](const std::string& line) {
               return line.find("result " + id + ", REGISTERED") != std::string::npos;
             }) == 1;
    }));
  }
}

TEST(Registration, TheCtThatIsHeldIsAnnounced) {
  RegistrationClient client("plain");
  std::mutex mutex;
  std::uint32_t crc32 = 0;
  const ::ros::Subscriber held = client.node.subscribe<msg::CtInfo>(
      "registration/ct", 1, [&](const msg::CtInfo::ConstPtr& info) {
        const std::lock_guard<std::mutex> lock(mutex);
        crc32 = info->crc32;
      });
  CtVolume other = agar().ct;
  other.voxels.front() += 1;
  for (const CtVolume* ct : {&agar().ct, static_cast<const CtVolume*>(&other)}) {
    client.send_ct(*ct, 1, ::ros::Time::now() - ::ros::Duration(1.0));
    const std::uint32_t sent = to_message(*ct, header("ct", ::ros::Time(1.0)), 1).crc32;
    EXPECT_TRUE(eventually([&] {
      const std::lock_guard<std::mutex> lock(mutex);
      return crc32 == sent;
    }));
  }
}

TEST(Registration, ACallerOfRegisterIsCancelledByTheService) {
  RegistrationClient client("anywhere");
  ::ros::ServiceClient cancel = client.node.serviceClient<msg::Cancel>("registration/cancel");
  msg::Cancel nothing;
  ASSERT_TRUE(cancel.call(nothing));
  EXPECT_EQ(nothing.response.status.code, Status::NOT_RUNNING);
  client.send_ct(agar().ct, 1, ::ros::Time::now() - ::ros::Duration(20.0));
  client.send(agar_ultrasound(::ros::Time::now()));
  client.call_until([](const Result& result) { return result.initial_alignment == "global"; });
  // A registration may end before the cancel arrives; the caller then asks again.
  std::future<Result> answer =
      std::async(std::launch::async, [&] { return client.call_until_code(Status::CANCELLED); });
  msg::Cancel::Response cancelled;
  EXPECT_TRUE(eventually([&] {
    msg::Cancel call;
    if (cancel.call(call) && call.response.status.code == Status::OK) cancelled = call.response;
    return answer.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  }));
  EXPECT_THAT(cancelled.status.message, HasSubstr("/anywhere/register"));
  EXPECT_EQ(answer.get().status.code, Status::CANCELLED);
}

TEST(Registration, GoalsThatCannotBeAreRefused) {
  RegistrationClient client("plain");
  provide_agar(client, 1);
  msg::RegisterGoal goal;
  goal.preset = "fastest";
  Result result = goal_result(client, goal);
  EXPECT_EQ(result.status.code, Status::UNKNOWN_PRESET);
  EXPECT_THAT(result.status.message, AllOf(HasSubstr("'fastest'"), HasSubstr("'fast'")));
  EXPECT_EQ(client.action.getState(), actionlib::SimpleClientGoalState::ABORTED);
  EXPECT_TRUE(is_zero(result.transform));

  goal.preset = "fast";
  goal.options = "search: {levels: {1: {optimizer: {initial_stepp: 3}}}}";
  result = goal_result(client, goal);
  EXPECT_EQ(result.status.code, Status::INVALID_REQUEST);
  EXPECT_THAT(result.status.message, HasSubstr("search.levels[1].optimizer.initial_stepp"));

  goal.options = "";
  goal.us_stamp = ::ros::Time(12.5);
  result = goal_result(client, goal);
  EXPECT_EQ(result.status.code, Status::NO_ULTRASOUND);
  EXPECT_THAT(result.status.message, HasSubstr("12.500"));

  goal.us_stamp = ::ros::Time();
  goal.use_initial = true;
  goal.initial.header.frame_id = "nowhere";
  goal.initial.transform.rotation.w = 1.0;
  result = goal_result(client, goal);
  EXPECT_EQ(result.status.code, Status::TF_UNAVAILABLE);
  EXPECT_THAT(result.status.message, AllOf(HasSubstr("'nowhere'"), HasSubstr("'us'")));
}

TEST(Registration, GoalRegistersWithProgress) {
  // These outlive the client, whose feedback may come late.
  std::mutex mutex;
  std::vector<msg::RegisterFeedback> feedback;
  RegistrationClient client("plain");
  provide_agar(client, 1);
  msg::RegisterGoal goal;
  goal.preset = "fast";
  goal.use_initial = true;
  goal.initial.header.frame_id = "us";
  goal.initial.transform = to_message(test::nearby(agar(), -1.0));
  ASSERT_TRUE(client.action.waitForServer(kLimit));
  client.action.sendGoal(goal, {}, {}, [&](const msg::RegisterFeedbackConstPtr& one) {
    const std::lock_guard<std::mutex> lock(mutex);
    feedback.push_back(*one);
  });
  ASSERT_TRUE(client.action.waitForResult(kLimit));
  EXPECT_EQ(client.action.getState(), actionlib::SimpleClientGoalState::SUCCEEDED);
  const Result result = result_of(client.action);
  EXPECT_EQ(result.status.code, Status::REGISTERED) << result.status.message;
  // The preset ends on 2 mm with half of the samples, and this case is small.
  EXPECT_LT(error_mm(result), 3.0 * kGoodMm);
  EXPECT_EQ(result.preset, "fast");
  EXPECT_EQ(result.initial_alignment, "goal");
  const std::lock_guard<std::mutex> lock(mutex);
  ASSERT_GE(feedback.size(), 3U);
  EXPECT_EQ(feedback.back().stage, "registering");
  for (std::size_t i = 1; i < feedback.size(); ++i)
    EXPECT_GE(feedback[i].progress, feedback[i - 1].progress);
}

/// With these a registration takes minutes.
constexpr const char* kLongOptions =
    "search: {starts: {count: 65536}, levels: {0: {screened: 8192, optimised: 8192}}}";

/// A goal that takes minutes; it is registering when this returns.
void start_long_goal(RegistrationClient& client) {
  msg::RegisterGoal goal;
  goal.preset = "phantom";
  goal.options = kLongOptions;
  // Feedback goes on after this function has returned, and the callback owns what it writes to.
  const auto registering = std::make_shared<std::atomic<bool>>(false);
  ASSERT_TRUE(client.action.waitForServer(kLimit));
  client.action.sendGoal(goal, {}, {}, [registering](const msg::RegisterFeedbackConstPtr& f) {
    if (f->stage == "registering" && f->progress >= 0.2F) *registering = true;
  });
  ASSERT_TRUE(eventually([&] { return registering->load(); }));
}

/// Time from the request to cancel until the result arrives.
double cancel_ms(RegistrationClient& client) {
  const ::ros::WallTime begin = ::ros::WallTime::now();
  client.action.cancelGoal();
  EXPECT_TRUE(client.action.waitForResult(kLimit));
  return (::ros::WallTime::now() - begin).toSec() * 1000.0;
}

TEST(Registration, OneAtATimeAndCancelled) {
  RegistrationClient client("plain");
  provide_agar(client, 1);
  start_long_goal(client);
  const Result busy = client.call();
  EXPECT_EQ(busy.status.code, Status::BUSY);
  EXPECT_THAT(busy.status.message, HasSubstr("register_with_options"));
  EXPECT_EQ(busy.id, 0U);
  Client second(client.node, "register_with_options", true);
  ASSERT_TRUE(second.waitForServer(kLimit));
  second.sendGoal(msg::RegisterGoal());
  ASSERT_TRUE(second.waitForResult(kLimit));
  EXPECT_EQ(second.getState(), actionlib::SimpleClientGoalState::REJECTED);
  EXPECT_EQ(result_of(second).status.code, Status::BUSY);

  const double took_ms = cancel_ms(client);
  std::printf("cancel to result: %.1f ms\n", took_ms);
  testing::Test::RecordProperty("cancel_us", static_cast<int>(1000.0 * took_ms));
  EXPECT_EQ(client.action.getState(), actionlib::SimpleClientGoalState::PREEMPTED);
  EXPECT_EQ(result_of(client.action).status.code, Status::CANCELLED);
  EXPECT_TRUE(is_zero(result_of(client.action).transform));
  EXPECT_EQ(client.call().status.code, Status::REGISTERED);
}

/// The cancel may arrive before the registration can be found.
TEST(Registration, CancelledAsSoonAsItIsAskedForItEnds) {
  RegistrationClient client("plain");
  provide_agar(client, 1);
  ASSERT_TRUE(client.action.waitForServer(kLimit));
  msg::RegisterGoal goal;
  goal.preset = "phantom";
  goal.options = kLongOptions;
  constexpr int kGoals = 100;
  for (int i = 0; i < kGoals; ++i) {
    client.action.sendGoal(goal);
    ::ros::WallDuration(1e-5 * (i % 40)).sleep();
    client.action.cancelGoal();
    ASSERT_TRUE(client.action.waitForResult(kLimit)) << i;
    // The answer of the registration that was cancelled may still be on its way.
    ASSERT_NE(client.action.getState(), actionlib::SimpleClientGoalState::SUCCEEDED) << i;
  }
}

TEST(Registration, NewCtWhileRunningEndsItWithoutTransform) {
  RegistrationClient client("plain");
  provide_agar(client, 1);
  start_long_goal(client);
  client.send_ct(agar().ct, 2, ::ros::Time::now() - ::ros::Duration(5.0));
  ASSERT_TRUE(client.action.waitForResult(kLimit));
  const Result refused = result_of(client.action);
  EXPECT_EQ(refused.status.code, Status::FAILED);
  EXPECT_THAT(refused.status.message, HasSubstr("another CT arrived while CT revision 1"));
  EXPECT_EQ(refused.ct_revision, 1U);
  EXPECT_TRUE(is_zero(refused.transform));
  EXPECT_EQ(client.call().ct_revision, 2U);
}

TEST(Registration, MalformedMessagesAreTheReasonUntilTheNext) {
  RegistrationClient client("plain");
  provide_agar(client, 3);
  msg::PreScanVolume bad = agar_ultrasound(::ros::Time::now());
  bad.lines = 4000000000U;
  client.send(bad);
  EXPECT_THAT(client.call_until_code(Status::INVALID_MESSAGE).status.message,
              HasSubstr("'lines' is 4000000000"));
  EXPECT_EQ(client.call().status.code, Status::INVALID_MESSAGE);
  client.send(agar_ultrasound(::ros::Time::now()));
  client.call_until_code(Status::REGISTERED);

  client.ct_publisher = client.node.advertise<msg::CtVolume>("ct/volume", 1, true);
  msg::CtVolume damaged = to_message(agar().ct, header("ct", ::ros::Time(1.0)), 4);
  damaged.data[1000] ^= 1;
  client.ct_publisher.publish(damaged);
  EXPECT_THAT(client.call_until_code(Status::INVALID_MESSAGE).status.message,
              AllOf(HasSubstr("CT revision 4"), HasSubstr("checksum")));
}

TEST(Registration, OutdatedUltrasoundIsRefused) {
  RegistrationClient client("plain");
  provide_agar(client, 5);
  // The same CT again, as after a restart of ct_server, outdates nothing.
  const ::ros::Time later = ::ros::Time::now() + ::ros::Duration(7.0);
  client.send_ct(agar().ct, 6, later);
  const Result again =
      client.call_until([](const Result& result) { return result.ct_revision == 6; });
  EXPECT_EQ(again.status.code, Status::REGISTERED) << again.status.message;
  EXPECT_LT(again.ct_stamp, again.us_stamp);
  CtVolume other = agar().ct;
  other.voxels[0] += 1;
  client.send_ct(other, 7, later);
  EXPECT_THAT(client.call_until_code(Status::ULTRASOUND_OUTDATED).status.message,
              HasSubstr("before the CT was loaded"));
}

}  // namespace
}  // namespace usct::ros_interface
