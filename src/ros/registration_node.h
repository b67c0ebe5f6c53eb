#pragma once

#include <actionlib/server/action_server.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <tf2_ros/transform_listener.h>
#include <us_ct_registration/Register.h>
#include <us_ct_registration/RegisterAction.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "ros/registrar.h"
#include "ros/registration_parameters.h"
#include "ros/registration_statistics.h"

namespace usct::ros_interface {

/// Registers the CT to ultrasound on request (service, action) or with each new volume: wires
/// topics and services to HeldVolumes, InitialAlignments and Registrar. docs/nodes/registration.md.
///
/// Callbacks come on threads of its own: a caller who waits for a registration holds up no other
/// nodelet. One thread registers, one registration at a time.
class RegistrationNode {
 public:
  RegistrationNode(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);
  ~RegistrationNode();
  RegistrationNode(const RegistrationNode&) = delete;
  RegistrationNode& operator=(const RegistrationNode&) = delete;

 private:
  using Result = us_ct_registration::RegistrationResult;
  using ActionServer = actionlib::ActionServer<us_ct_registration::RegisterAction>;

  struct Job {
    std::string name;
    RegistrationRequest request;
    std::atomic<bool> cancelled{false};
    /// Empty for continuous registrations: nobody waits.
    std::function<void(const Result&)> done;
    std::string goal_id;
  };

  void subscribe();
  ::ros::Subscriber subscribe_ct();
  ::ros::Subscriber subscribe_ultrasound();

  bool on_register(us_ct_registration::Register::Request&,
                   us_ct_registration::Register::Response& response);
  bool on_set_initial_alignment(us_ct_registration::SetInitialAlignment::Request& request,
                                us_ct_registration::SetInitialAlignment::Response& response);
  void on_goal(ActionServer::GoalHandle goal);
  void on_cancel(ActionServer::GoalHandle goal);

  /// Takes the only place for a request; false, with a result that says so, if it is taken.
  bool reserve(const std::string& name, Result& busy);
  std::shared_ptr<Job> make_job(const std::string& name) const;
  void start(const std::shared_ptr<Job>& job);

  void work();
  std::shared_ptr<Job> next_job();
  void run(const std::shared_ptr<Job>& job);
  void explain_nothing(Job& job, Result& result);
  void publish(Result& result, bool continuous);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);
  void wake();

  ::ros::CallbackQueue queue_;
  ::ros::NodeHandle node_;
  const RegistrationParameters parameters_;
  tf2::BufferCore tf_;
  tf2_ros::TransformListener tf_listener_;
  FixedFrame frame_;
  InitialAlignments alignments_;
  RegistrationStatistics statistics_;

  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;
  std::string reserved_;          // name of the request that waits or runs; empty: none
  std::shared_ptr<Job> pending_;  // has the place, waits to be run
  std::shared_ptr<Job> running_;
  std::uint64_t continued_ = 0;  // the ultrasound that was last registered continuously
  std::uint32_t last_id_ = 0;

  HeldVolumes volumes_;
  Registrar registrar_;
  ::ros::Publisher result_publisher_;
  ::ros::Subscriber ct_subscriber_;
  ::ros::Subscriber ultrasound_subscriber_;
  ::ros::Subscriber alignment_subscriber_;
  ::ros::ServiceServer register_service_;
  ::ros::ServiceServer set_service_;
  ActionServer action_;
  diagnostic_updater::Updater updater_;
  ::ros::WallTimer diagnostics_timer_;
  std::thread worker_;
  ::ros::AsyncSpinner spinner_;
};

}  // namespace usct::ros_interface
