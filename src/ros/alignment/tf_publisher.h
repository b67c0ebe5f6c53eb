#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>
#include <us_ct_registration/CtInfo.h>
#include <us_ct_registration/Decide.h>
#include <us_ct_registration/RegistrationResult.h>

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "ros/alignment/alignment_broadcaster.h"
#include "ros/tf/tf_watch.h"
#include "us_ct_registration/alignment/alignment_decisions.h"

namespace usct::ros_interface {

/// Decides which registration counts, and has it broadcast as the transform from fixed frame to CT
/// frame: wires topics and services to AlignmentDecisions, AlignmentBroadcaster and TfWatch.
/// docs/nodes/tf_publisher.md.
class TfPublisher {
 public:
  TfPublisher(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  using Decide = us_ct_registration::Decide;
  using Change = std::function<DecisionAnswer(AlignmentDecisions&)>;
  using TfEvent = ::ros::MessageEvent<const tf2_msgs::TFMessage>;

  void advertise();
  void subscribe();
  void restore();
  /// Writes the file, if there is to be one. Throws as `write_alignment`.
  void store(const StoredAlignment& stored);
  /// A suspension counts even if it cannot be stored.
  void store_suspension();
  void on_result(const us_ct_registration::RegistrationResultConstPtr& result);
  /// Applies a result; the mutex is held.
  void take(const us_ct_registration::RegistrationResult& result);
  /// Waits for a result that is newer than all that came: who called the registration may have its
  /// answer, and decide, before the result has come on its topic. Gives up after two seconds.
  void await_result(std::uint64_t result_id);
  void on_ct(CtSource source, const us_ct_registration::CtInfoConstPtr& info);
  void on_tf(const TfEvent& event, bool is_static);
  bool decide(const Change& change, Decide::Response& response);
  /// Why a person has to decide on a result even with the policy `auto`, in words; empty if no
  /// reason is known.
  std::string why_ask(const us_ct_registration::RegistrationResult& result) const;
  /// Why the alignment that is in force after a change must not be broadcast; empty if it may.
  std::string conflict(const AlignmentState& state) const;
  /// Makes a change and stores it. If it cannot be stored or broadcast, nothing changes.
  us_ct_registration::StatusCode apply(const Change& change);
  /// Broadcasts and publishes the state, suspended if tf speaks against it. Returns as
  /// `AlignmentBroadcaster::show`.
  ::ros::Time show();
  /// Suspends the alignment, and hides the one that waits, if tf speaks against it.
  void check_tf();
  /// The alignment that waits for a decision, in the frame `proposed_frame_`; empty if tf speaks
  /// against that frame or the parameter is.
  std::optional<Alignment> proposed(const AlignmentState& state) const;
  /// Publishes the alignment that is broadcast, if any, as messages that other packages know.
  void publish_pose(const AlignmentState& state);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis);

  const std::int64_t started_ns_;
  ::ros::NodeHandle node_;
  std::string policy_;
  ::ros::WallDuration tolerance_;
  TfWatch watch_;
  std::string proposed_frame_;
  std::unique_ptr<AlignmentBroadcaster> broadcaster_;
  std::unique_ptr<AlignmentBroadcaster> proposed_broadcaster_;

  std::mutex mutex_;  // guards the members below, up to newest_id_
  AlignmentDecisions decisions_{{}};
  std::string alignment_file_;
  std::string last_refusal_;
  std::string file_error_;
  /// The largest number of a result that came, accepted or not.
  std::uint64_t newest_id_ = 0;

  std::condition_variable result_came_;

  ::ros::Publisher alignment_publisher_;
  ::ros::Publisher proposed_publisher_;
  ::ros::Publisher pose_publisher_;
  ::ros::Publisher transform_publisher_;
  ::ros::Subscriber result_subscriber_;
  ::ros::Subscriber ct_subscriber_;
  ::ros::Subscriber registered_ct_subscriber_;
  ::ros::Subscriber tf_subscriber_;
  ::ros::Subscriber tf_static_subscriber_;
  ::ros::ServiceServer accept_server_;
  ::ros::ServiceServer reject_server_;
  ::ros::ServiceServer revert_server_;
  diagnostic_updater::Updater diagnostics_;
  ::ros::WallTimer tf_timer_;
  ::ros::WallTimer diagnostics_timer_;
  ::ros::WallTimer pose_timer_;
};

}  // namespace usct::ros_interface
