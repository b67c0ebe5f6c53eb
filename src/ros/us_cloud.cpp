#include "ros/us_cloud.h"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <algorithm>
#include <cmath>

#include "ros/conversions.h"
#include "ros/parameters.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/ultrasound/decimation.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

void add_line(const PreScanVolume& volume, const BeamGrid& beams, int frame, int line, int step,
              std::vector<CloudPoint>& points) {
  for (int sample = 0; sample < beams.samples(); sample += step)
    points.push_back(
        {beams.point(frame, line, sample), static_cast<float>(volume.at(sample, line, frame))});
}

}  // namespace

Eigen::Isometry3d T_us_acquired(const ScanGeometry& geometry) {
  const auto* tracked = std::get_if<TrackedSweep>(&geometry.motion);
  if (tracked == nullptr || tracked->T_us_frame.empty()) return Eigen::Isometry3d::Identity();
  return tracked->T_us_frame[tracked->T_us_frame.size() / 2];
}

Eigen::Isometry3d T_us_field(const ScanGeometry& geometry) {
  const BeamGrid beams = beam_grid(geometry);
  Eigen::Isometry3d T = T_us_acquired(geometry);
  T.translation() = beams.point(beams.frames / 2, beams.lines / 2, beams.samples() / 2);
  return T;
}

std::vector<CloudPoint> crossed_fans(const PreScanVolume& volume, double spacing_mm) {
  const BeamGrid beams = beam_grid(volume.geometry);
  const int step =
      std::max(1, static_cast<int>(std::ceil(spacing_mm / volume.geometry.axial.spacing_mm)));
  std::vector<CloudPoint> points;
  for (int line = 0; line < beams.lines; ++line)
    add_line(volume, beams, beams.frames / 2, line, step, points);
  for (int frame = 0; frame < beams.frames; ++frame)
    if (frame != beams.frames / 2) add_line(volume, beams, frame, beams.lines / 2, step, points);
  return points;
}

std::vector<CloudPoint> whole_volume(const PreScanVolume& volume, double spacing_mm) {
  const BeamUltrasound recorded = along_beams(volume);
  const BeamUltrasound us = decimate(recorded, factors_for_spacing(recorded.beams, spacing_mm));
  std::vector<CloudPoint> points;
  points.reserve(us.brightness.size());
  for (int frame = 0; frame < us.beams.frames; ++frame)
    for (int line = 0; line < us.beams.lines; ++line)
      for (int sample = 0; sample < us.beams.samples(); ++sample)
        points.push_back({us.beams.point(frame, line, sample), us.brightness[points.size()]});
  return points;
}

std::vector<CloudPoint> ct_at(const std::vector<CloudPoint>& points, const CtVolume& ct,
                              const Eigen::Isometry3d& T_ct_points) {
  std::vector<CloudPoint> result;
  for (const CloudPoint& point : points) {
    const Eigen::Vector3d index = ct.grid.index_from_physical(T_ct_points * point.p_mm);
    if (!contains_index(ct.grid, index)) continue;
    result.push_back(
        {point.p_mm, sample_at_index(ct, index, Interpolation::kTrilinear, Outside::edge())});
  }
  return result;
}

sensor_msgs::PointCloud2 to_message(const std::vector<CloudPoint>& points,
                                    const std_msgs::Header& header) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header = header;
  cloud.height = 1;
  cloud.is_dense = true;
  sensor_msgs::PointCloud2Modifier modifier(cloud);
  constexpr auto kFloat = sensor_msgs::PointField::FLOAT32;
  modifier.setPointCloud2Fields(4, "x", 1, kFloat, "y", 1, kFloat, "z", 1, kFloat, "intensity", 1,
                                kFloat);
  modifier.resize(points.size());
  sensor_msgs::PointCloud2Iterator<float> value(cloud, "x");
  for (const CloudPoint& point : points) {
    const Eigen::Vector3d p_m = point.p_mm / kMmPerM;
    for (int axis = 0; axis < 3; ++axis) value[axis] = static_cast<float>(p_m[axis]);
    value[3] = point.intensity;
    ++value;
  }
  return cloud;
}

visualization_msgs::MarkerArray placed(const visualization_msgs::MarkerArray& surfaces_ct,
                                       const msg::Alignment& alignment, double alpha) {
  visualization_msgs::MarkerArray result;
  if (alignment.state == msg::Alignment::NONE) {
    result.markers.resize(1);
    result.markers[0].action = visualization_msgs::Marker::DELETEALL;
    return result;
  }
  result = surfaces_ct;
  const geometry_msgs::Pose pose =
      to_pose_message(from_message_mm(alignment.transform, "registration/alignment"));
  for (visualization_msgs::Marker& marker : result.markers) {
    marker.header.frame_id = alignment.header.frame_id;
    marker.pose = pose;
    marker.color.a = static_cast<float>(alpha);
  }
  return result;
}

UsCloud::UsCloud(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node), tf_listener_(tf_, node_) {
  Parameters parameters(private_node);
  fixed_frame_ = parameters.text("fixed_frame", "");
  acquired_frame_ = parameters.text("acquired_frame", "us_acquired");
  field_frame_ = parameters.text("field_frame", "us_field");
  spacing_mm_ = kMmPerM * parameters.number("spacing", 0.0005, 1e-4, 0.1);
  volume_spacing_mm_ = kMmPerM * parameters.number("volume_spacing", 0.002, 1e-4, 0.1);
  surface_alpha_ = parameters.number("surface_alpha", 0.35, 0.0, 1.0);
  tf_timeout_ = ::ros::Duration(parameters.number("tf_timeout", 1.0, 0.0, 60.0));
  parameters.finish();
  us_publisher_ = node_.advertise<sensor_msgs::PointCloud2>("us/cloud", 1, true);
  volume_publisher_ = node_.advertise<sensor_msgs::PointCloud2>("us/volume_cloud", 1, true);
  ct_publisher_ = node_.advertise<sensor_msgs::PointCloud2>("ct/cloud", 1, true);
  surface_publisher_ =
      node_.advertise<visualization_msgs::MarkerArray>("ct/surface_placed", 1, true);
  us_subscriber_ = node_.subscribe("us/volume", 1, &UsCloud::show_ultrasound, this);
  ct_subscriber_ = node_.subscribe("ct/volume", 1, &UsCloud::take_ct, this);
  surface_subscriber_ = node_.subscribe("ct/surface", 1, &UsCloud::take_surface, this);
  alignment_subscriber_ =
      node_.subscribe("registration/alignment", 1, &UsCloud::take_alignment, this);
}

void UsCloud::show_ultrasound(const msg::PreScanVolumeConstPtr& message) try {
  const PreScanVolume us = from_message(*message, us_subscriber_.getTopic());
  std::vector<CloudPoint> fans = crossed_fans(us, spacing_mm_);
  std::vector<CloudPoint> whole = whole_volume(us, volume_spacing_mm_);
  std_msgs::Header header = message->header;
  if (!fixed_frame_.empty()) {
    const geometry_msgs::TransformStamped fixed_us =
        tf_.lookupTransform(fixed_frame_, header.frame_id, header.stamp, tf_timeout_);
    const Eigen::Isometry3d T_fixed_us = from_message_mm(fixed_us.transform, "tf");
    for (std::vector<CloudPoint>* points : {&fans, &whole})
      for (CloudPoint& point : *points) point.p_mm = T_fixed_us * point.p_mm;
    header.frame_id = fixed_frame_;
    geometry_msgs::TransformStamped acquired = fixed_us;
    acquired.child_frame_id = acquired_frame_;
    acquired.transform = to_message(T_fixed_us * T_us_acquired(us.geometry));
    geometry_msgs::TransformStamped field = fixed_us;
    field.child_frame_id = field_frame_;
    field.transform = to_message(T_fixed_us * T_us_field(us.geometry));
    broadcaster_.sendTransform({acquired, field});
  }
  us_publisher_.publish(to_message(fans, header));
  volume_publisher_.publish(to_message(whole, header));
  {
    const std::lock_guard lock(mutex_);
    header_ = header;
    fans_ = std::move(fans);
  }
  show_ct();
} catch (const InputError& error) {
  ROS_ERROR("%s", error.what());
} catch (const tf2::TransformException& error) {
  ROS_ERROR("ultrasound of %.3f s is not shown: tf: %s", message->header.stamp.toSec(),
            error.what());
}

void UsCloud::take_ct(const msg::CtVolumeConstPtr& message) try {
  auto ct = std::make_shared<const CtVolume>(from_message(*message, ct_subscriber_.getTopic()));
  {
    const std::lock_guard lock(mutex_);
    ct_ = std::move(ct);
  }
  show_ct();
} catch (const InputError& error) {
  ROS_ERROR("%s", error.what());
}

void UsCloud::take_alignment(const msg::AlignmentConstPtr& message) {
  {
    const std::lock_guard lock(mutex_);
    alignment_ = message;
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

void UsCloud::show_ct() try {
  const std::lock_guard lock(mutex_);
  if (surface_ && alignment_)
    surface_publisher_.publish(placed(*surface_, *alignment_, surface_alpha_));
  if (fans_.empty()) return;
  std::vector<CloudPoint> points;
  if (ct_ && alignment_ && alignment_->state != msg::Alignment::NONE &&
      alignment_->header.frame_id == header_.frame_id)
    points =
        ct_at(fans_, *ct_,
              from_message_mm(alignment_->transform, alignment_subscriber_.getTopic()).inverse());
  ct_publisher_.publish(to_message(points, header_));
} catch (const InputError& error) {
  ROS_ERROR("%s", error.what());
}

}  // namespace usct::ros_interface
