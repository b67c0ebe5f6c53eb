#pragma once

#include <actionlib/server/action_server.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <us_ct_registration/Cancel.h>
#include <us_ct_registration/CtInfo.h>
#include <us_ct_registration/Register.h>
#include <us_ct_registration/RegisterAction.h>

#include <cstdint>
#include <string>

#include "ros/node/guarded_queue.h"
#include "ros/registration/decision_watch.h"
#include "ros/registration/registrar.h"
#include "ros/registration/registration_parameters.h"
#include "ros/registration/registration_queue.h"
#include "ros/registration/registration_statistics.h"
#include "ros/registration/registration_worker.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"

namespace usct::ros_interface {

/// Registers the CT to ultrasound on request (service, action) or with each new volume: wires
/// topics, services and the action to HeldVolumes, InitialAlignments, Registrar and
/// RegistrationWorker. docs/nodes/registration.md.
///
/// The node has its own callback threads, so that a caller who waits for a registration holds up no
/// other nodelet.
class RegistrationNode {
 public:
  RegistrationNode(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);
  ~RegistrationNode();
  RegistrationNode(const RegistrationNode&) = delete;
  RegistrationNode& operator=(const RegistrationNode&) = delete;

 private:
  using Result = us_ct_registration::RegistrationResult;
  using ActionServer = actionlib::ActionServer<us_ct_registration::RegisterAction>;

  void subscribe();
  ::ros::Subscriber subscribe_ct();
  ::ros::Subscriber subscribe_ultrasound();

  void on_alignment(const us_ct_registration::Alignment::ConstPtr& message);
  bool on_register(us_ct_registration::Register::Request&,
                   us_ct_registration::Register::Response& response);
  bool on_set_initial_alignment(us_ct_registration::SetInitialAlignment::Request& request,
                                us_ct_registration::SetInitialAlignment::Response& response);
  bool on_cancel_request(us_ct_registration::Cancel::Request&,
                         us_ct_registration::Cancel::Response& response);
  void on_goal(ActionServer::GoalHandle goal);
  void on_cancel(ActionServer::GoalHandle goal);

  /// Reserves the queue's place for a request. If it is taken, returns false and says so in `busy`.
  bool reserve(const std::string& name, Result& busy);
  /// Settings and callbacks of the worker.
  RegistrationWorker::Work work();
  /// Never throws.
  Result run(RegistrationJob& job);
  /// Completes the result of a registration, counts and publishes it.
  void finish(const RegistrationJob& job, Result& result);
  /// Adds to a refusal for lack of a volume the reason why no volume has arrived.
  void explain_nothing(const RegistrationJob& job, Result& result);
  /// Gives the result its number, and publishes, counts and logs it.
  void publish(Result& result, bool continuous);
  /// What a person has to do before a registered result is broadcast, in words.
  std::string next_step(const Result& result) const;
  /// Publishes which CT is held, if it is another one than before.
  void announce_ct();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  ::ros::CallbackQueue queue_;
  GuardedQueue guarded_{queue_};
  ::ros::NodeHandle node_;
  const RegistrationParameters parameters_;
  TfBuffer tf_;
  TfInput tf_input_;
  FixedFrame frame_;
  InitialAlignments alignments_;
  DecisionWatch decisions_;
  RegistrationStatistics statistics_;

  RegistrationQueue jobs_;
  std::uint64_t last_id_ = 0;

  // Both are used by the thread of `volumes_`.
  ::ros::Publisher ct_publisher_;
  us_ct_registration::CtInfo announced_ct_;
  HeldVolumes volumes_;
  Registrar registrar_;
  ::ros::Publisher result_publisher_;
  ::ros::Subscriber ct_announcement_subscriber_;
  ::ros::Subscriber ct_subscriber_;
  ::ros::Subscriber ultrasound_subscriber_;
  ::ros::Subscriber announcement_subscriber_;
  ::ros::Subscriber alignment_subscriber_;
  ::ros::ServiceServer register_service_;
  ::ros::ServiceServer set_service_;
  ::ros::ServiceServer cancel_service_;
  ActionServer action_;
  diagnostic_updater::Updater updater_;
  ::ros::WallTimer diagnostics_timer_;
  // The threads are the last members: they start when all other members exist and end before any of
  // those is destroyed, also if the constructor throws.
  RegistrationWorker worker_;
  ::ros::AsyncSpinner spinner_;
};

}  // namespace usct::ros_interface
