#include <actionlib/client/simple_action_client.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <tf2_ros/transform_broadcaster.h>
#include <topic_tools/shape_shifter.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/Register.h>
#include <us_ct_registration/RegisterAction.h>
#include <us_ct_registration/SetInitialAlignment.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <sstream>
#include <thread>

#include "core/registration/registration_cases.h"
#include "ros/conversions.h"
#include "ros/refusal.h"
#include "us_ct_registration/registration/rough_pose.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Status = msg::StatusCode;
using Result = msg::RegistrationResult;
using Client = actionlib::SimpleActionClient<msg::RegisterAction>;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using testing::AllOf;
using testing::HasSubstr;

constexpr double kGoodMm = 1.0;
const ::ros::Duration kLimit(60.0);
const ::ros::WallDuration kPoll(0.01);

template <typename Condition>
bool eventually(Condition&& condition) {
  const ::ros::WallTime end = ::ros::WallTime::now() + ::ros::WallDuration(kLimit.toSec());
  while (::ros::WallTime::now() < end) {
    if (condition()) return true;
    kPoll.sleep();
  }
  return false;
}

std_msgs::Header header(const std::string& frame, const ::ros::Time& stamp) {
  std_msgs::Header header;
  header.frame_id = frame;
  header.stamp = stamp;
  return header;
}

const test::RegistrationCase& agar() { return test::agar_case(); }

msg::PreScanVolume agar_ultrasound(const ::ros::Time& stamp, const std::string& frame = "us") {
  static const msg::PreScanVolume message =
      to_message(test::agar_phantom().ultrasound, header("us", ::ros::Time(1.0)));
  msg::PreScanVolume copy = message;
  copy.header = header(frame, stamp);
  return copy;
}

bool is_zero(const geometry_msgs::Transform& transform) {
  const auto& t = transform.translation;
  const auto& r = transform.rotation;
  return t.x == 0.0 && t.y == 0.0 && t.z == 0.0 && r.x == 0.0 && r.y == 0.0 && r.z == 0.0 &&
         r.w == 0.0;
}

/// One registration node, as its users see it.
class RegistrationClient {
 public:
  explicit RegistrationClient(const std::string& ns)
      : node(ns),
        service(node.serviceClient<msg::Register>("register")),
        set_service(
            node.serviceClient<msg::SetInitialAlignment>("registration/set_initial_alignment")),
        action(node, "register_with_options", true) {
    results_ = node.subscribe<Result>("registration/result", 100, [this](const auto& result) {
      const std::lock_guard<std::mutex> lock(mutex_);
      published_.push_back(*result);
    });
    EXPECT_TRUE(eventually([&] { return results_.getNumPublishers() > 0; }));
    EXPECT_TRUE(service.waitForExistence(kLimit));
    EXPECT_TRUE(set_service.waitForExistence(kLimit));
  }

  void send_ct(const CtVolume& ct, unsigned revision, const ::ros::Time& stamp) {
    if (!ct_publisher) ct_publisher = node.advertise<msg::CtVolume>("ct/volume", 1, true);
    ct_publisher.publish(to_message(ct, header("ct", stamp), revision));
  }
  void send(const msg::PreScanVolume& message) {
    if (!us_publisher) us_publisher = node.advertise<msg::PreScanVolume>("us/volume", 1, true);
    us_publisher.publish(message);
  }
  Result call() {
    msg::Register call;
    EXPECT_TRUE(service.call(call));
    EXPECT_EQ(call.response.success, call.response.result.status.code == Status::REGISTERED);
    EXPECT_EQ(call.response.message, call.response.result.status.message);
    return call.response.result;
  }
  /// What was sent may still be on its way.
  template <typename Condition>
  Result call_until(Condition&& condition) {
    Result result;
    EXPECT_TRUE(eventually([&] {
      result = call();
      return condition(result);
    })) << code_name(result.status.code)
        << ": " << result.status.message;
    return result;
  }
  Result call_until_code(std::uint8_t code) {
    return call_until([&](const Result& result) { return result.status.code == code; });
  }
  msg::SetInitialAlignment::Response set(const Isometry3d& T_frame_ct, const std::string& frame) {
    msg::SetInitialAlignment call;
    call.request.type = msg::SetInitialAlignment::Request::POSE;
    call.request.header.frame_id = frame;
    call.request.transform = to_message(T_frame_ct);
    EXPECT_TRUE(set_service.call(call));
    return call.response;
  }
  std::vector<Result> published() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return published_;
  }

  ::ros::NodeHandle node;
  ::ros::ServiceClient service;
  ::ros::ServiceClient set_service;
  Client action;
  ::ros::Publisher ct_publisher;
  ::ros::Publisher us_publisher;

 private:
  mutable std::mutex mutex_;
  std::vector<Result> published_;
  ::ros::Subscriber results_;  // last: it ends first, and with it the calls that use what is above
};

Result goal_result(RegistrationClient& client, const msg::RegisterGoal& goal) {
  EXPECT_TRUE(client.action.waitForServer(kLimit));
  client.action.sendGoal(goal);
  EXPECT_TRUE(client.action.waitForResult(kLimit));
  return client.action.getResult() ? client.action.getResult()->result : Result();
}

/// CT, ultrasound and an initial alignment beside the truth, held by a node.
void provide_agar(RegistrationClient& client, unsigned revision) {
  const ::ros::Time now = ::ros::Time::now();
  client.send_ct(agar().ct, revision, now - ::ros::Duration(1.0));
  client.send(agar_ultrasound(now));
  ASSERT_TRUE(
      eventually([&] { return client.set(test::nearby(agar()), "us").status.code == Status::OK; }));
  // A goal that cannot be registered says what is held.
  ASSERT_TRUE(eventually([&] {
    msg::RegisterGoal goal;
    goal.us_stamp = now;
    goal.use_initial = true;
    goal.initial.header.frame_id = "nowhere";
    goal.initial.transform.rotation.w = 1.0;
    const Result result = goal_result(client, goal);
    return result.us_stamp == now && result.ct_revision == revision;
  }));
}

double error_mm(const Result& result) {
  return agar().error_mm(from_message_mm(result.transform, "result"));
}

std::string output_of(const std::string& command) {
  std::string output;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return output;
  std::array<char, 4096> text{};
  while (fgets(text.data(), static_cast<int>(text.size()), pipe) != nullptr) output += text.data();
  output += "\nexit status " + std::to_string(WEXITSTATUS(pclose(pipe)));
  return output;
}

/// A latched message of the type's name with other fields.
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
  // The same bits, however it is called.
  const auto& t = result.transform.translation;
  EXPECT_LT((translation_m - Vector3d(t.x, t.y, t.z)).norm(), 1e-9);
}

TEST(Registration, IdsRiseAlsoWithRefusals) {
  RegistrationClient client("plain");
  const std::uint32_t first = client.call().id;
  EXPECT_GT(first, 0U);
  EXPECT_EQ(client.call().id, first + 1);
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
  RegistrationClient client("plain");
  provide_agar(client, 1);
  msg::RegisterGoal goal;
  goal.preset = "fast";
  goal.use_initial = true;
  goal.initial.header.frame_id = "us";
  goal.initial.transform = to_message(test::nearby(agar(), -1.0));
  std::mutex mutex;
  std::vector<msg::RegisterFeedback> feedback;
  ASSERT_TRUE(client.action.waitForServer(kLimit));
  client.action.sendGoal(goal, {}, {}, [&](const msg::RegisterFeedbackConstPtr& one) {
    const std::lock_guard<std::mutex> lock(mutex);
    feedback.push_back(*one);
  });
  ASSERT_TRUE(client.action.waitForResult(kLimit));
  EXPECT_EQ(client.action.getState(), actionlib::SimpleClientGoalState::SUCCEEDED);
  const Result result = client.action.getResult()->result;
  EXPECT_EQ(result.status.code, Status::REGISTERED) << result.status.message;
  EXPECT_LT(error_mm(result), 2.0 * kGoodMm);  // the preset's last stage is on 2 mm
  EXPECT_EQ(result.preset, "fast");
  EXPECT_EQ(result.initial_alignment, "goal");
  const std::lock_guard<std::mutex> lock(mutex);
  ASSERT_GE(feedback.size(), 3U);
  EXPECT_EQ(feedback.back().stage, "registering");
  for (std::size_t i = 1; i < feedback.size(); ++i)
    EXPECT_GE(feedback[i].progress, feedback[i - 1].progress);
}

/// A goal that takes minutes; it is registering when this returns.
void start_long_goal(RegistrationClient& client) {
  msg::RegisterGoal goal;
  goal.preset = "phantom";
  goal.options = "search: {starts: {count: 65536}, levels: {0: {optimised: 4096}}}";
  std::atomic<bool> registering{false};
  ASSERT_TRUE(client.action.waitForServer(kLimit));
  client.action.sendGoal(goal, {}, {}, [&](const msg::RegisterFeedbackConstPtr& feedback) {
    if (feedback->stage == "registering" && feedback->progress >= 0.2F) registering = true;
  });
  ASSERT_TRUE(eventually([&] { return registering.load(); }));
}

/// From the request to cancel until the result is there.
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
  EXPECT_EQ(second.getResult()->result.status.code, Status::BUSY);

  const double took_ms = cancel_ms(client);
  std::printf("cancel to result: %.1f ms\n", took_ms);
  testing::Test::RecordProperty("cancel_us", static_cast<int>(1000.0 * took_ms));
  EXPECT_EQ(client.action.getState(), actionlib::SimpleClientGoalState::PREEMPTED);
  EXPECT_EQ(client.action.getResult()->result.status.code, Status::CANCELLED);
  EXPECT_TRUE(is_zero(client.action.getResult()->result.transform));
  EXPECT_EQ(client.call().status.code, Status::REGISTERED);
}

TEST(Registration, NewCtWhileRunningEndsItWithoutTransform) {
  RegistrationClient client("plain");
  provide_agar(client, 1);
  start_long_goal(client);
  client.send_ct(agar().ct, 2, ::ros::Time::now() - ::ros::Duration(5.0));
  ASSERT_TRUE(client.action.waitForResult(kLimit));
  const Result refused = client.action.getResult()->result;
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
  client.send_ct(agar().ct, 6, ::ros::Time::now() + ::ros::Duration(7.0));
  EXPECT_THAT(client.call_until_code(Status::ULTRASOUND_OUTDATED).status.message,
              HasSubstr("before the CT was loaded"));
}

TEST(Registration, NoInitialAlignmentIsRefused) {
  RegistrationClient client("plain");
  provide_agar(client, 7);
  msg::SetInitialAlignment clear;
  clear.request.type = msg::SetInitialAlignment::Request::CLEAR;
  ASSERT_TRUE(client.set_service.call(clear));
  EXPECT_EQ(clear.response.status.code, Status::OK);
  EXPECT_THAT(client.call_until_code(Status::NO_INITIAL_ALIGNMENT).status.message,
              HasSubstr("allow_global is false"));
}

/// The CT turned so that the way the probe looked, which is all that the node knows, is 20 degrees
/// off.
TEST(Registration, GlobalSearchIfAllowed) {
  RegistrationClient client("anywhere");
  const Isometry3d rough = rough_pose(agar().ct.grid, agar().us.beams, ProbeDirection{});
  Isometry3d turn = test::rigid({0.2, -0.2, 0.2}, {0, 0, 0});
  turn.linear() *= rough.linear().transpose() * agar().T_us_ct_true.linear();
  const test::RegistrationCase turned = test::moved(agar(), Isometry3d::Identity(), turn);
  client.send_ct(turned.ct, 1, ::ros::Time::now() - ::ros::Duration(20.0));
  client.send(agar_ultrasound(::ros::Time::now()));
  const Result result = client.call_until_code(Status::REGISTERED);
  EXPECT_EQ(result.initial_alignment, "global");
  EXPECT_EQ(result.preset, "global");
  EXPECT_LT(turned.error_mm(from_message_mm(result.transform, "result")), kGoodMm);
}

TEST(Registration, LandmarksAreAnInitialAlignment) {
  RegistrationClient client("plain");
  provide_agar(client, 8);
  msg::SetInitialAlignment set;
  set.request.type = msg::SetInitialAlignment::Request::LANDMARKS;
  set.request.header.frame_id = "us";
  const Isometry3d T_ct_us = test::nearby(agar()).inverse();
  for (std::size_t i = 0; i < 200; i += 40) {
    const Vector3d p = agar().targets_us_mm.at(i);
    set.request.points.push_back(to_message(p));
    set.request.points_ct.push_back(to_message(Vector3d(T_ct_us * p)));
  }
  ASSERT_TRUE(client.set_service.call(set));
  EXPECT_EQ(set.response.status.code, Status::OK) << set.response.status.message;
  EXPECT_NEAR(set.response.residual, 0.0, 1e-9);
  EXPECT_LT(error_mm(client.call_until_code(Status::REGISTERED)), kGoodMm);
  set.request.points.resize(2);
  set.request.points_ct.resize(2);
  ASSERT_TRUE(client.set_service.call(set));
  EXPECT_EQ(set.response.status.code, Status::INVALID_REQUEST);
}

/// Says all the time where the ultrasound's frame is in "patient".
class Tracking {
 public:
  using Pose = std::function<Isometry3d(double time_s)>;
  explicit Tracking(Pose pose) : pose_(std::move(pose)), thread_([this] { run(); }) {}
  ~Tracking() {
    stopping_ = true;
    thread_.join();
  }
  Isometry3d T_patient_us(const ::ros::Time& time) const { return pose_(time.toSec()); }

 private:
  void run() {
    tf2_ros::TransformBroadcaster broadcaster;
    while (!stopping_) {
      const ::ros::Time now = ::ros::Time::now();
      geometry_msgs::TransformStamped transform;
      transform.header = header("patient", now);
      transform.child_frame_id = "us";
      transform.transform = to_message(pose_(now.toSec()));
      broadcaster.sendTransform(transform);
      kPoll.sleep();
    }
  }

  const Pose pose_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

const Isometry3d kPatientUs = test::rigid({0.3, -0.8, 0.5}, {210, -90, 1500});

TEST(Registration, FixedFrameNeedsTfAtTheStamp) {
  RegistrationClient client("fixed");
  client.send_ct(agar().ct, 1, ::ros::Time::now() - ::ros::Duration(20.0));
  client.send(agar_ultrasound(::ros::Time::now(), "untracked"));
  EXPECT_THAT(client.call_until_code(Status::TF_UNAVAILABLE).status.message,
              AllOf(HasSubstr("'untracked'"), HasSubstr("'patient'")));

  const double jump_s = ::ros::Time::now().toSec() + 1.0;
  const Tracking tracking([&](double time_s) {
    return time_s < jump_s ? Isometry3d(kPatientUs * test::rigid({0, 0, 0}, {0, 0, 25}))
                           : kPatientUs;
  });
  EXPECT_EQ(client.set(kPatientUs * test::nearby(agar()), "patient").status.code, Status::OK);
  client.send(agar_ultrasound(::ros::Time(jump_s)));
  EXPECT_THAT(client.call_until_code(Status::TF_JUMPED).status.message,
              AllOf(HasSubstr("moved by"), HasSubstr("'us'"), HasSubstr("'patient'")));

  client.send(agar_ultrasound(::ros::Time::now() + ::ros::Duration(1000.0)));
  EXPECT_THAT(client.call_until_code(Status::TF_STALE).status.message,
              AllOf(HasSubstr("'us'"), HasSubstr("before the ultrasound's stamp")));
  for (const Result& result : client.published()) EXPECT_TRUE(is_zero(result.fixed_transform));
}

TEST(Registration, ResultIsAnchoredInTheFixedFrame) {
  RegistrationClient client("fixed");
  const Tracking tracking([](double) { return kPatientUs; });
  client.send_ct(agar().ct, 2, ::ros::Time::now() - ::ros::Duration(20.0));
  EXPECT_EQ(client.set(kPatientUs * test::nearby(agar()), "patient").status.code, Status::OK);
  ::ros::Time stamp;
  ASSERT_TRUE(eventually([&] {
    stamp = ::ros::Time::now();
    client.send(agar_ultrasound(stamp));
    return client.call().status.code == Status::REGISTERED;
  }));
  const Result result = client.call();
  ASSERT_EQ(result.status.code, Status::REGISTERED) << result.status.message;
  EXPECT_LT(error_mm(result), kGoodMm);
  EXPECT_EQ(result.fixed_frame, "patient");
  EXPECT_TRUE(from_message_mm(result.fixed_transform, "result")
                  .isApprox(kPatientUs * from_message_mm(result.transform, "result"), 1e-6));
}

/// The patient's phantom, as tracked frames: in a frame that moves, they say the same.
msg::PreScanVolume seen_from(const Isometry3d& T_patient_us, const ::ros::Time& stamp) {
  static const phantom::PhantomCase patient = phantom::make_phantom(
      test::small_phantom(phantom::SceneKind::kPatient, phantom::SweepKind::kTrackedCurvilinear));
  PreScanVolume volume = patient.ultrasound;
  auto& sweep = std::get<TrackedSweep>(volume.geometry.motion);
  sweep.frame_times_s.clear();
  for (Isometry3d& T : sweep.T_us_frame) T = T_patient_us.inverse() * kPatientUs * T;
  return to_message(volume, header("us", stamp));
}

msg::Alignment accepted_alignment(const Isometry3d& T_patient_ct) {
  msg::Alignment alignment;
  alignment.header = header("patient", ::ros::Time::now());
  alignment.state = msg::Alignment::ACCEPTED;
  alignment.ct_frame = "ct";
  alignment.transform = to_message(T_patient_ct);
  alignment.accepted = ::ros::Time::now();
  return alignment;
}

TEST(Registration, ContinuousNodeletFollowsTheProbe) {
  RegistrationClient client("continuous");
  const test::RegistrationCase& images = test::patient_case();
  const Tracking tracking([](double time_s) {
    return Isometry3d(
        kPatientUs * test::rigid({0.05 * std::sin(time_s), 0, 0}, {15.0 * std::sin(time_s), 0, 0}));
  });
  ::ros::Publisher alignment =
      client.node.advertise<msg::Alignment>("registration/alignment", 1, true);
  alignment.publish(accepted_alignment(kPatientUs * test::nearby(images)));
  client.send_ct(images.ct, 1, ::ros::Time::now() - ::ros::Duration(20.0));
  constexpr std::size_t kWanted = 6;
  std::vector<Result> registered;
  EXPECT_TRUE(eventually([&] {
    const ::ros::Time now = ::ros::Time::now();
    client.send(seen_from(tracking.T_patient_us(now), now));
    registered.clear();
    for (const Result& result : client.published())
      if (result.status.code == Status::REGISTERED) registered.push_back(result);
    return registered.size() >= kWanted;
  })) << registered.size()
      << " of " << client.published().size()
      << "; last: " << (client.published().empty() ? "" : client.published().back().status.message);
  double moved_mm = 0.0;
  for (const Result& result : registered) {
    EXPECT_EQ(result.initial_alignment, "accepted");
    const Isometry3d T_us_ct = from_message_mm(result.transform, "result");
    const Isometry3d T_patient_us = tracking.T_patient_us(result.us_stamp);
    const Isometry3d found = from_message_mm(result.fixed_transform, "result");
    EXPECT_LT(images.error_mm(kPatientUs.inverse() * found), 2.0 * kGoodMm);
    // tf interpolates between poses that are hundredths of seconds apart.
    EXPECT_LT(images.error_mm(kPatientUs.inverse() * T_patient_us * T_us_ct), 2.5 * kGoodMm);
    moved_mm =
        std::max(moved_mm, (T_us_ct.translation() -
                            from_message_mm(registered.front().transform, "result").translation())
                               .norm());
  }
  EXPECT_GT(moved_mm, 1.0);
  for (std::size_t i = 1; i < registered.size(); ++i)
    EXPECT_GT(registered[i].us_stamp, registered[i - 1].us_stamp);
}

TEST(Registration, ContinuousNodeletAnswersRequestsAndDiagnoses) {
  RegistrationClient client("continuous");
  std::mutex mutex;
  std::map<std::string, std::string> values;
  const ::ros::Subscriber diagnostics = client.node.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& array) {
        const std::lock_guard<std::mutex> lock(mutex);
        for (const auto& status : array->status)
          if (status.name == "continuous/registration: registration")
            for (const auto& value : status.values) values[value.key] = value.value;
      });
  EXPECT_NE(client.call().status.code, Status::BUSY);
  EXPECT_TRUE(eventually([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return values.count("continuous rate, Hz") > 0 && values["CT revision"] == "1" &&
           values.count("last status") > 0 && values["ultrasound volumes held"] != "0";
  }));
}

TEST(Registration, WrongParametersEndTheNodeNamingThem) {
  const auto started_with = [](const std::string& parameters) {
    const auto node =
        std::filesystem::read_symlink("/proc/self/exe").parent_path() / "registration";
    return output_of(node.string() + " __name:=wrong " + parameters);
  };
  EXPECT_THAT(started_with("_options:='search: {levels: {0: {spacing: 3}}}'"),
              AllOf(HasSubstr("/wrong/options"), HasSubstr("search.levels[0].spacing"),
                    HasSubstr("exit status 2")));
  EXPECT_EQ(std::system("rosparam delete /wrong"), 0);
  EXPECT_THAT(started_with("_preset:=fastest"),
              AllOf(HasSubstr("fastest"), HasSubstr("exit status 2")));
  EXPECT_EQ(std::system("rosparam delete /wrong"), 0);
  EXPECT_THAT(started_with("_max_tf_agee:=1.0"),
              AllOf(HasSubstr("/wrong/max_tf_agee"), HasSubstr("exit status 2")));
}

}  // namespace
}  // namespace usct::ros_interface

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ::ros::init(argc, argv, "test_registration");
  ::ros::NodeHandle keep_alive;
  ::ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
