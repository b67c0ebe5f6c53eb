#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <us_ct_registration/CtInfo.h>

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "ros/operator/operator_state.h"
#include "ros/operator/service_calls.h"
#include "ros/slicer/igtl_server.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"

namespace usct::ros_interface {

/// The node `slicer_bridge` links 3D Slicer, or another program that speaks OpenIGTLink: it sends
/// where the CT is in the ultrasound while tf says so, and in words what counts and what waits; it
/// takes landmarks and decisions. docs/nodes/slicer_bridge.md.
class SlicerBridge {
 public:
  SlicerBridge(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  /// What all clients are told.
  struct News {
    /// `p_us = T p_ct`, mm; empty if it is not known or does not count.
    std::optional<Eigen::Isometry3d> T_us_ct;
    /// The same to the ultrasound as it was acquired, wherever the probe is now.
    std::optional<Eigen::Isometry3d> T_us_ct_acquired;
    /// What counts, or why nothing is sent.
    std::string status;
    /// What waits for a decision, or was refused, with the evidence.
    std::string subject;
  };

  /// The pose of the result in force, as it was registered; empty if it is not known.
  std::optional<Eigen::Isometry3d> as_acquired() const;
  void subscribe();
  /// Hands the messages of a topic to `state_` and tells the clients.
  template <class Message>
  ::ros::Subscriber follow(const std::string& topic, void (OperatorState::*take)(const Message&));
  void serve(const IgtlServerOptions& options);
  /// The caller must hold `mutex_`, as of all functions below it.
  void take_message(const IgtlHeader& header, const std::string& content);
  void take_landmarks(const std::string& name, const std::vector<Eigen::Vector3d>& points_lps_mm);
  void obey(const std::string& command);
  /// Calls a service and sends what it answers; `words` makes them from its response.
  template <class Service, class Words>
  void call(const std::string& name, const typename Service::Request& request, Words words);
  void answer(const std::string& words);
  News news() const;
  /// As in News; sets `why_not` if there is none.
  std::optional<Eigen::Isometry3d> look_up(std::string& why_not) const;
  std::string words_of(const News& news) const;
  /// Sends the transform, and the words if they have changed or were last sent a second ago.
  void tick();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis);

  ::ros::NodeHandle node_;
  std::string us_frame_;
  double max_tf_age_s_ = 0.0;
  TfBuffer tf_;
  TfInput tf_input_;

  std::mutex mutex_;  // guards the members below, up to last_event_
  OperatorState state_;
  ServiceCalls calls_;
  /// Frame and checksum of the CT that is held.
  std::pair<std::string, std::uint32_t> held_ct_;
  /// Landmarks by the name of their list, LPS, mm.
  std::map<std::string, std::vector<Eigen::Vector3d>> landmarks_;
  std::string sent_words_;
  ::ros::WallTime words_sent_at_;
  std::string last_event_;

  diagnostic_updater::Updater diagnostics_;
  std::unique_ptr<IgtlServer> server_;
  ::ros::Subscriber alignment_;
  ::ros::Subscriber proposed_;
  ::ros::Subscriber result_;
  ::ros::Subscriber ct_;
  ::ros::WallTimer timer_;
  ::ros::WallTimer diagnostics_timer_;
};

}  // namespace usct::ros_interface
