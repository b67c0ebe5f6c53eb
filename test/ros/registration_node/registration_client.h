#pragma once

#include <actionlib/client/simple_action_client.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>
#include <us_ct_registration/Register.h>
#include <us_ct_registration/RegisterAction.h>
#include <us_ct_registration/SetInitialAlignment.h>

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "core/registration/registration_cases.h"
#include "ros/conversions/ct.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "ros/eventually.h"
#include "ros/node/refusal.h"
#include "ros/tf_source.h"

namespace usct::ros_interface {

namespace msg = us_ct_registration;
using Status = msg::StatusCode;
using Result = msg::RegistrationResult;
using Client = actionlib::SimpleActionClient<msg::RegisterAction>;

constexpr double kGoodMm = 1.0;

/// The newest message of a topic.
template <typename Message>
class Newest {
 public:
  Newest(::ros::NodeHandle& node, const std::string& topic)
      : subscriber_(
            node.subscribe<Message>(topic, 10, [this](const typename Message::ConstPtr& message) {
              const std::lock_guard<std::mutex> lock(mutex_);
              newest_ = message;
            })) {}

  void shut_down() { subscriber_.shutdown(); }

  /// The first message that fulfils the condition; an empty one, and a failure, if none does.
  Message wait(const std::function<bool(const Message&)>& condition) const {
    typename Message::ConstPtr found;
    EXPECT_TRUE(eventually([&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      found = newest_ && condition(*newest_) ? newest_ : nullptr;
      return found != nullptr;
    })) << subscriber_.getTopic();
    return found ? *found : Message();
  }

 private:
  mutable std::mutex mutex_;
  typename Message::ConstPtr newest_;
  ::ros::Subscriber subscriber_;  // last: its callback uses the others
};

std_msgs::Header header(const std::string& frame, const ::ros::Time& stamp);

inline const test::RegistrationCase& agar() { return test::agar_case(); }
msg::PreScanVolume agar_ultrasound(const ::ros::Time& stamp, const std::string& frame = "us");
/// A pose of the ultrasound frame in the frame `patient`, to publish on tf.
tf2_msgs::TFMessage tf_of_us(const ::ros::Time& stamp, const Eigen::Isometry3d& T_patient_us,
                             const std::string& us_frame);

/// A motorised sweep of a probe that moves meanwhile, with the stamp of each frame, and the poses
/// of the probe, to publish on tf before the sweep.
struct MovingSweep {
  msg::PreScanVolume sweep;
  tf2_msgs::TFMessage poses;
};

/// The phantom's sweep, which ends now. The probe turns about the axis of its motor by `share` of
/// the sweep's angle, and the motor by the rest: both together, the frames are the phantom's.
/// `drift_mm` moves the probe along x as well, which makes its images wrong.
MovingSweep moving_sweep(const Eigen::Isometry3d& T_patient_us, double share, double drift_mm,
                         const std::string& us_frame);

bool is_zero(const geometry_msgs::Transform& transform);
/// Distance of the result's pose from the truth of the case `agar`.
double error_mm(const Result& result);
/// The output of a shell command, and its exit status.
std::string output_of(const std::string& command);

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
  /// Whether the node is connected to the publishers of both, once both have been sent.
  bool is_heard() const {
    return ct_publisher.getNumSubscribers() > 0 && us_publisher.getNumSubscribers() > 0;
  }
  Result call() {
    msg::Register call;
    // roscpp sometimes closes the connection before it has read the answer (ros_comm, issue 1976).
    EXPECT_TRUE(service.call(call) || service.call(call));
    EXPECT_EQ(call.response.success, call.response.result.status.code == Status::REGISTERED);
    EXPECT_EQ(call.response.message, call.response.result.status.message);
    return call.response.result;
  }
  /// Waits for a condition, since a message that was sent may not have arrived yet.
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
  msg::SetInitialAlignment::Response set(const Eigen::Isometry3d& T_frame_ct,
                                         const std::string& frame) {
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
  ::ros::Subscriber results_;  // last: its callback uses the members above
};

/// The result of the goal that has ended; an empty one, and a failure, if the client has none: then
/// it lost track of the goal, and its pointer to the result is null.
Result result_of(const Client& action);

Result goal_result(RegistrationClient& client, const msg::RegisterGoal& goal);

/// Sends CT, ultrasound and an initial alignment beside the truth to a node, and waits until it has
/// them.
void provide_agar(RegistrationClient& client, unsigned revision);

}  // namespace usct::ros_interface
