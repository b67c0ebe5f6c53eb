#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>
#include <us_ct_registration/CtInfo.h>
#include <us_ct_registration/Decide.h>
#include <us_ct_registration/RegistrationResult.h>

#include <functional>
#include <mutex>
#include <string>

#include "us_ct_registration/registration/alignment_decisions.h"

namespace usct::ros_interface {

/// Broadcasts the accepted registration as the transform from fixed frame to CT frame.
/// docs/nodes/tf_publisher.md.
class TfPublisher {
 public:
  TfPublisher(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  using Decide = us_ct_registration::Decide;
  using Change = std::function<DecisionAnswer(AlignmentDecisions&)>;

  void restore();
  /// Writes the file if its content has changed. Throws as `write_alignment`.
  void store(const StoredAlignment& changed);
  void on_result(const us_ct_registration::RegistrationResultConstPtr& result);
  void on_ct(const us_ct_registration::CtInfoConstPtr& info);
  bool decide(const Change& change, Decide::Response& response);
  /// Makes a change and stores it. If it cannot be stored, nothing changes.
  us_ct_registration::StatusCode apply(const Change& change);
  void publish_alignment();
  void broadcast();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis);

  ::ros::NodeHandle node_;
  std::mutex mutex_;  // guards the members below, up to file_error_
  AlignmentDecisions decisions_{{}};
  std::string alignment_file_;
  ::ros::Duration transform_tolerance_;
  ::ros::Time last_now_;
  ::ros::Time last_stamp_;
  std::string last_refusal_;
  std::string file_error_;

  tf2_ros::TransformBroadcaster broadcaster_;
  ::ros::Publisher alignment_publisher_;
  ::ros::Subscriber result_subscriber_;
  ::ros::Subscriber ct_subscriber_;
  ::ros::ServiceServer accept_server_;
  ::ros::ServiceServer reject_server_;
  ::ros::ServiceServer revert_server_;
  diagnostic_updater::Updater diagnostics_;
  ::ros::Timer broadcast_timer_;
  ::ros::WallTimer still_clock_timer_;
  ::ros::WallTimer diagnostics_timer_;
};

}  // namespace usct::ros_interface
