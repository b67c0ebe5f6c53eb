#include "ros/fusion/us_cloud.h"

#include "ros/conversions/alignment.h"
#include "ros/conversions/ct.h"
#include "ros/conversions/point_clouds.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/surface_markers.h"
#include "ros/conversions/times.h"
#include "ros/conversions/ultrasound.h"
#include "ros/node/guarded_queue.h"
#include "ros/node/parameters.h"
#include "ros/tf/fixed_frame.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/probe_motion.h"

namespace usct::ros_interface {

namespace msg = us_ct_registration;

UsCloud::UsCloud(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node),
      tf_input_(tf_, node_),
      diagnostics_(node, private_node, private_node.getNamespace()) {
  Parameters parameters(private_node);
  fixed_frame_ = parameters.frame("fixed_frame", "");
  acquired_frame_ = parameters.frame("acquired_frame", "us_acquired");
  field_frame_ = parameters.frame("field_frame", "us_field");
  spacing_mm_ = kMmPerM * parameters.number("spacing", 0.0005, 1e-4, 0.1);
  volume_spacing_mm_ = kMmPerM * parameters.number("volume_spacing", 0.002, 1e-4, 0.1);
  surface_alpha_ = parameters.number("surface_alpha", 0.35, 0.0, 1.0);
  tf_timeout_s_ = parameters.number("tf_timeout", 1.0, 0.0, 60.0);
  const double diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  us_publisher_ = node_.advertise<sensor_msgs::PointCloud2>("us/cloud", 1, true);
  volume_publisher_ = node_.advertise<sensor_msgs::PointCloud2>("us/volume_cloud", 1, true);
  ct_publisher_ = node_.advertise<sensor_msgs::PointCloud2>("ct/cloud", 1, true);
  surface_publisher_ =
      node_.advertise<visualization_msgs::MarkerArray>("ct/surface_placed", 1, true);
  proposed_publisher_ =
      node_.advertise<visualization_msgs::MarkerArray>("ct/surface_proposed", 1, true);
  refused_ct_publisher_ = node_.advertise<sensor_msgs::PointCloud2>("ct/cloud_refused", 1, true);
  refused_surface_publisher_ =
      node_.advertise<visualization_msgs::MarkerArray>("ct/surface_refused", 1, true);
  show_ct();  // rviz keeps what a node showed that has ended
  us_subscriber_ = node_.subscribe("us/volume", 1, &UsCloud::take_ultrasound, this);
  ct_subscriber_ = node_.subscribe("ct/volume", 1, &UsCloud::take_ct, this);
  surface_subscriber_ = node_.subscribe("ct/surface", 1, &UsCloud::take_surface, this);
  alignment_subscriber_ =
      node_.subscribe("registration/alignment", 1, &UsCloud::take_alignment, this);
  proposed_subscriber_ = node_.subscribe("registration/proposed", 1, &UsCloud::take_proposed, this);
  result_subscriber_ = node_.subscribe("registration/result", 1, &UsCloud::take_result, this);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("clouds", this, &UsCloud::diagnose);
  alignment_timer_ = node_.createWallTimer(
      ::ros::WallDuration(AlignmentWatch::kPeriod_s),
      guarded([this](const ::ros::WallTimerEvent&) { look_for_alignment(); }));
  diagnostics_timer_ = node_.createWallTimer(::ros::WallDuration(diagnostic_period_s),
                                             guarded([this](const ::ros::WallTimerEvent&) {
                                               show_unplaced();
                                               diagnostics_.force_update();
                                             }));
}

Eigen::Isometry3d UsCloud::look_up_fixed_frame(const ScanGeometry& geometry, double tf_wait_s,
                                               std_msgs::Header& header) {
  const geometry_msgs::TransformStamped fixed_us =
      wait_for_transform(tf_, fixed_frame_, header.frame_id, header.stamp, tf_wait_s);
  const Eigen::Isometry3d T_fixed_us = from_message_mm(fixed_us.transform, "tf");
  header.frame_id = fixed_frame_;
  const auto mark = [&](const std::string& frame, const Eigen::Isometry3d& T_us_frame) {
    if (frame.empty()) return;
    geometry_msgs::TransformStamped marked = fixed_us;
    marked.child_frame_id = frame;
    marked.transform = to_message(T_fixed_us * T_us_frame);
    broadcaster_.sendTransform(marked);
  };
  mark(acquired_frame_, T_us_acquired(geometry));
  mark(field_frame_, T_us_field(geometry));
  return T_fixed_us;
}

void UsCloud::follow_frames(const msg::PreScanVolume& message, const Eigen::Isometry3d& T_fixed_us,
                            BeamGrid& beams) const {
  if (message.frame_stamps.empty()) return;
  FixedFrameOptions options;
  options.frame = fixed_frame_;
  const FixedFrame frame(tf_, options);
  follow_probe(frame.T_us_then(message.header, {T_fixed_us, 0.0}, message.frame_stamps), beams);
}

void UsCloud::take_ultrasound(const msg::PreScanVolumeConstPtr& message) {
  const std::lock_guard lock(showing_);
  show_ultrasound(message, tf_timeout_s_);
}

void UsCloud::show_unplaced() {
  const std::unique_lock lock(showing_, std::try_to_lock);
  if (!lock || !unplaced_) return;
  const msg::PreScanVolumeConstPtr again = unplaced_;
  show_ultrasound(again, 0.0);
}

UsCloud::Shown UsCloud::publish_ultrasound(const msg::PreScanVolume& message, double tf_wait_s) {
  require_stamped(message.header.stamp, ::ros::Time::now(), us_subscriber_.getTopic());
  const PreScanVolume us = from_message(message, us_subscriber_.getTopic());
  BeamUltrasound seen = along_beams(us);
  Shown shown;
  shown.header = message.header;
  if (!fixed_frame_.empty()) {
    shown.T_cloud_us = look_up_fixed_frame(us.geometry, tf_wait_s, shown.header);
    follow_frames(message, shown.T_cloud_us, seen.beams);
  }
  shown.fans = crossed_fans(seen, spacing_mm_);
  std::vector<CloudPoint> whole = whole_volume(seen, volume_spacing_mm_);
  constexpr double kAboveMm = 25.0;
  constexpr double kFarAboveMm = 60.0;
  constexpr double kBelowMm = 55.0;
  const double half_depth_mm = 0.5 * us.geometry.axial.spacing_mm * us.geometry.samples();
  shown.above_mm =
      shown.T_cloud_us * T_us_acquired(us.geometry) * Eigen::Vector3d(0.0, -kAboveMm, 0.0);
  shown.far_above_mm =
      shown.T_cloud_us * T_us_acquired(us.geometry) * Eigen::Vector3d(0.0, -kFarAboveMm, 0.0);
  shown.below_mm = shown.T_cloud_us * T_us_field(us.geometry) *
                   Eigen::Vector3d(0.0, half_depth_mm + kBelowMm, 0.0);
  for (std::vector<CloudPoint>* points : {&shown.fans, &whole})
    for (CloudPoint& point : *points) point.p_mm = shown.T_cloud_us * point.p_mm;
  us_publisher_.publish(to_message(shown.fans, shown.header));
  volume_publisher_.publish(to_message(whole, shown.header));
  return shown;
}

void UsCloud::show_ultrasound(const msg::PreScanVolumeConstPtr& message, double tf_wait_s) {
  const bool is_new = message != unplaced_;
  unplaced_.reset();
  const auto fail = [&](const std::exception& error) {
    const std::lock_guard lock(mutex_);
    problem_ =
        "ultrasound of " + seconds_text(message->header.stamp) + " s is not shown: " + error.what();
    if (is_new) ROS_ERROR("%s", problem_.c_str());
  };
  try {
    Shown shown = publish_ultrasound(*message, tf_wait_s);
    const std::lock_guard lock(mutex_);
    shown_ = std::move(shown);
    problem_.clear();
  } catch (const InputError& error) {
    return fail(error);
  } catch (const std::exception& error) {  // tf
    unplaced_ = message;
    return fail(error);
  }
  show_ct();
}

void UsCloud::take_ct(const msg::CtVolumeConstPtr& message) try {
  auto ct = std::make_shared<const CtVolume>(from_message(*message, ct_subscriber_.getTopic()));
  {
    const std::lock_guard lock(mutex_);
    ct_ = std::move(ct);
    ct_crc32_ = message->crc32;
  }
  show_ct();
} catch (const InputError& error) {
  ROS_ERROR("%s", error.what());
}

UsCloud::Placement UsCloud::placement_of(const msg::Alignment& message) {
  Placement placement{message.header.frame_id, message.message, std::nullopt, message.ct_crc32};
  try {
    placement.T_fixed_ct = T_fixed_ct_from(message);
  } catch (const InputError& error) {
    ROS_ERROR("%s", error.what());
  }
  return placement;
}

void UsCloud::take_alignment(const msg::AlignmentConstPtr& message) {
  {
    const std::lock_guard lock(mutex_);
    placement_ = placement_of(*message);
    alignment_watch_.arrived(*message);
  }
  show_ct();
}

void UsCloud::look_for_alignment() {
  {
    const std::lock_guard lock(mutex_);
    if (!alignment_watch_.look_up(tf_, ::ros::Time::now(), AlignmentWatch::Clock::now())) return;
  }
  show_ct();
}

void UsCloud::take_proposed(const msg::AlignmentConstPtr& message) {
  {
    const std::lock_guard lock(mutex_);
    proposed_ = placement_of(*message);
  }
  show_ct();
}

void UsCloud::take_surface(const visualization_msgs::MarkerArrayConstPtr& message) {
  {
    const std::lock_guard lock(mutex_);
    surface_ = message;
  }
  show_ct();
}

void UsCloud::take_result(const msg::RegistrationResultConstPtr& message) {
  // As in the overlay: a person cancelled it and knows it.
  if (message->status.code == msg::StatusCode::CANCELLED) return;
  {
    const std::lock_guard lock(mutex_);
    const bool is_drawn =
        message->status.code != msg::StatusCode::REGISTERED && !message->candidates.empty();
    refused_ = is_drawn ? message : nullptr;
  }
  show_ct();
}

void UsCloud::show_ct() {
  const std::lock_guard lock(mutex_);
  show_aligned();
  show_proposed();
  show_refused();
}

std::string UsCloud::cloud_frame() const {
  return fixed_frame_.empty() && shown_ ? shown_->header.frame_id : fixed_frame_;
}

void UsCloud::publish_ct(const ::ros::Publisher& publisher,
                         const std::vector<CloudPoint>& points) const {
  std_msgs::Header header;
  header.frame_id = cloud_frame();
  if (shown_) header = shown_->header;
  // rviz takes no cloud without a frame.
  if (!header.frame_id.empty()) publisher.publish(to_message(points, header));
}

bool UsCloud::has_surface_of(std::uint32_t ct_crc32) const {
  return surface_ && ct_crc32_of(*surface_).value_or(ct_crc32) == ct_crc32;
}

void UsCloud::show_proposed() {
  visualization_msgs::MarkerArray markers = placed({}, cloud_frame(), std::nullopt, 0.0);
  const bool is_of_another_ct = ct_ && proposed_ && proposed_->ct_crc32 != ct_crc32_;
  if (proposed_ && proposed_->T_fixed_ct && !is_of_another_ct &&
      has_surface_of(proposed_->ct_crc32)) {
    ProposedAlignment shown{proposed_->fixed_frame, *proposed_->T_fixed_ct, proposed_->message, {}};
    if (shown_ && shown_->header.frame_id == shown.frame) shown.text_mm = shown_->above_mm;
    markers = proposed_markers(*surface_, shown, surface_alpha_);
  }
  proposed_publisher_.publish(markers);
}

void UsCloud::show_aligned() {
  const std::string& problem = alignment_watch_.problem();
  const bool is_in_force = placement_ && placement_->T_fixed_ct && problem.empty();
  const bool is_shown = is_in_force && has_surface_of(placement_->ct_crc32);
  visualization_msgs::MarkerArray markers =
      placed(surface_ ? *surface_ : visualization_msgs::MarkerArray(),
             is_shown ? placement_->fixed_frame : cloud_frame(),
             is_shown ? placement_->T_fixed_ct : std::nullopt, surface_alpha_);
  if (shown_ && !problem.empty())
    markers.markers.push_back(not_in_force_marker(problem, cloud_frame(), shown_->far_above_mm));
  surface_publisher_.publish(markers);
  std::vector<CloudPoint> points;
  if (shown_ && ct_ && is_in_force && placement_->ct_crc32 == ct_crc32_ &&
      placement_->fixed_frame == shown_->header.frame_id)
    points = ct_at(shown_->fans, *ct_, placement_->T_fixed_ct->inverse());
  publish_ct(ct_publisher_, points);
}

void UsCloud::show_refused() try {
  std::vector<CloudPoint> points;
  visualization_msgs::MarkerArray markers = placed({}, cloud_frame(), std::nullopt, 0.0);
  if (shown_ && refused_ && refused_->us_stamp == shown_->header.stamp && ct_ &&
      refused_->ct_crc32 == ct_crc32_) {
    const Eigen::Isometry3d T_cloud_ct =
        shown_->T_cloud_us *
        from_message_mm(refused_->candidates.front().transform, result_subscriber_.getTopic());
    points = ct_at(shown_->fans, *ct_, T_cloud_ct.inverse());
    markers = refused_markers(
        has_surface_of(refused_->ct_crc32) ? *surface_ : visualization_msgs::MarkerArray(),
        {shown_->header.frame_id, T_cloud_ct, refused_->status.message, shown_->above_mm,
         shown_->below_mm},
        surface_alpha_);
  }
  publish_ct(refused_ct_publisher_, points);
  refused_surface_publisher_.publish(markers);
} catch (const InputError& error) {
  ROS_ERROR("%s", error.what());
}

void UsCloud::diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  using diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard lock(mutex_);
  diagnosis.summary(DiagnosticStatus::OK,
                    shown_ ? "ultrasound is shown" : "waiting for ultrasound");
  for (const std::string& problem : {problem_, alignment_watch_.problem()})
    if (!problem.empty()) diagnosis.mergeSummary(DiagnosticStatus::WARN, problem);
  if (shown_)
    diagnosis.add("age of the ultrasound [s]",
                  seconds_between(shown_->header.stamp, ::ros::Time::now()));
  diagnosis.add("CT", ct_ ? "received" : "none");
  diagnosis.add("surfaces", surface_ ? "received" : "none");
  diagnosis.add("alignment", placement_ ? placement_->message : "none");
  diagnosis.add("proposed", proposed_ ? proposed_->message : "none");
}

}  // namespace usct::ros_interface
