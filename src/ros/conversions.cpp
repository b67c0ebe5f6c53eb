#include "ros/conversions.h"

#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

constexpr double kQuaternionTolerance = 1e-3;

void require(bool fulfilled, const std::string& source, const std::string& violation) {
  if (!fulfilled) throw InputError(source, violation);
}

template <typename T>
std::uint32_t checksum(const std::vector<T>& data) {
  uLong crc = crc32_z(0, nullptr, 0);
  crc = crc32_z(crc, reinterpret_cast<const Bytef*>(data.data()), data.size() * sizeof(T));
  return static_cast<std::uint32_t>(crc);
}

template <typename T>
void require_checksum(const std::vector<T>& data, std::uint32_t expected,
                      const std::string& source) {
  const std::uint32_t found = checksum(data);
  require(found == expected, source,
          "the checksum of 'data' is " + std::to_string(found) + ", 'crc32' says " +
              std::to_string(expected) + ": the voxels were damaged on their way");
}

/// Sizes come from outside: their product must be that of the data, which is there already.
void require_size(std::initializer_list<std::pair<const char*, std::uint32_t>> sizes,
                  std::size_t data, const std::string& source) {
  std::string product;
  double voxels = 1.0;
  for (const auto& [name, size] : sizes) {
    require(
        size >= 1 && size <= static_cast<std::uint32_t>(std::numeric_limits<std::int32_t>::max()),
        source, "'" + std::string(name) + "' is " + std::to_string(size) + ", must be >= 1");
    voxels *= size;
    product += (product.empty() ? "" : " x ") + std::to_string(size);
  }
  require(voxels == static_cast<double>(data), source,
          "'data' has " + std::to_string(data) + " values, must have " + product);
}

void require_count(const char* name, std::size_t count, std::size_t wanted,
                   const std::string& source) {
  require(count == wanted, source,
          "'" + std::string(name) + "' has " + std::to_string(count) + " entries, must have " +
              std::to_string(wanted));
}

Eigen::Isometry3d rigid_mm(const Eigen::Quaterniond& q, const Eigen::Vector3d& translation_m,
                           const std::string& source) {
  require(translation_m.allFinite(), source, "the translation is not finite");
  require(std::abs(q.norm() - 1.0) <= kQuaternionTolerance, source,
          "the quaternion has length " + std::to_string(q.norm()) + ", must be 1");
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = q.normalized().toRotationMatrix();
  T.translation() = kMmPerM * translation_m;
  return T;
}

std::vector<double> scaled(const std::vector<double>& values, double factor) {
  std::vector<double> result(values);
  for (double& value : result) value *= factor;
  return result;
}

bool is_motorised(const msg::ProbeGeometry& message) {
  return message.type == msg::ProbeGeometry::MOTORISED_CURVILINEAR;
}

/// What the type of geometry has no use for must not be set: it would be lost.
void require_unused(const char* name, bool unused, const std::string& source) {
  require(unused, source, "'" + std::string(name) + "' is set, but the type of probe has none");
}

double seconds_since_first(const std::vector<::ros::Time>& stamps, std::size_t i) {
  return (stamps[i] - stamps.front()).toSec();
}

}  // namespace

Eigen::Vector3d point_from_message_mm(const geometry_msgs::Point& point_m) {
  return kMmPerM * Eigen::Vector3d(point_m.x, point_m.y, point_m.z);
}

geometry_msgs::Point to_message(const Eigen::Vector3d& point_mm) {
  geometry_msgs::Point point;
  point.x = point_mm.x() / kMmPerM;
  point.y = point_mm.y() / kMmPerM;
  point.z = point_mm.z() / kMmPerM;
  return point;
}

Eigen::Isometry3d from_message_mm(const geometry_msgs::Transform& transform_m,
                                  const std::string& source) {
  const auto& q = transform_m.rotation;
  const auto& t = transform_m.translation;
  return rigid_mm(Eigen::Quaterniond(q.w, q.x, q.y, q.z), Eigen::Vector3d(t.x, t.y, t.z), source);
}

Eigen::Isometry3d from_message_mm(const geometry_msgs::Pose& pose_m, const std::string& source) {
  const auto& q = pose_m.orientation;
  const auto& t = pose_m.position;
  return rigid_mm(Eigen::Quaterniond(q.w, q.x, q.y, q.z), Eigen::Vector3d(t.x, t.y, t.z), source);
}

geometry_msgs::Pose to_pose_message(const Eigen::Isometry3d& T_mm) {
  geometry_msgs::Pose pose;
  pose.position = to_message(Eigen::Vector3d(T_mm.translation()));
  const Eigen::Quaterniond q(T_mm.linear());
  pose.orientation.w = q.w();
  pose.orientation.x = q.x();
  pose.orientation.y = q.y();
  pose.orientation.z = q.z();
  return pose;
}

geometry_msgs::Transform to_message(const Eigen::Isometry3d& T_mm) {
  const geometry_msgs::Pose pose = to_pose_message(T_mm);
  geometry_msgs::Transform transform;
  transform.translation.x = pose.position.x;
  transform.translation.y = pose.position.y;
  transform.translation.z = pose.position.z;
  transform.rotation = pose.orientation;
  return transform;
}

msg::ProbeGeometry to_probe_message(const ScanGeometry& geometry) {
  msg::ProbeGeometry message;
  message.start_depth = geometry.axial.start_depth_mm / kMmPerM;
  message.sample_spacing = geometry.axial.spacing_mm / kMmPerM;
  if (const auto* curved = std::get_if<CurvilinearArray>(&geometry.array)) {
    message.type = msg::ProbeGeometry::TRACKED_CURVILINEAR;
    message.probe_radius = curved->probe_radius_mm / kMmPerM;
    message.line_angles = curved->line_angles_rad;
  } else {
    message.type = msg::ProbeGeometry::TRACKED_LINEAR;
    message.line_positions =
        scaled(std::get<LinearArray>(geometry.array).line_positions_mm, 1.0 / kMmPerM);
  }
  if (const auto* sweep = std::get_if<MotorSweep>(&geometry.motion)) {
    message.type = msg::ProbeGeometry::MOTORISED_CURVILINEAR;
    message.motor_radius = sweep->motor_radius_mm / kMmPerM;
  }
  return message;
}

Array array_from_message(const msg::ProbeGeometry& message, const std::string& source) {
  if (message.type == msg::ProbeGeometry::TRACKED_LINEAR) {
    require_unused("line_angles", message.line_angles.empty(), source);
    require_unused("probe_radius", message.probe_radius == 0.0, source);
    return LinearArray{scaled(message.line_positions, kMmPerM)};
  }
  require(is_motorised(message) || message.type == msg::ProbeGeometry::TRACKED_CURVILINEAR, source,
          "'geometry.type' is " + std::to_string(message.type) + ", must be 1, 2 or 3");
  require_unused("line_positions", message.line_positions.empty(), source);
  require_unused("motor_radius", is_motorised(message) || message.motor_radius == 0.0, source);
  return CurvilinearArray{kMmPerM * message.probe_radius, message.line_angles};
}

AxialSampling axial_from_message(const msg::ProbeGeometry& message, unsigned samples,
                                 const std::string& source) {
  require(samples >= 2, source, "'samples' is " + std::to_string(samples) + ", must be >= 2");
  return {static_cast<int>(samples), kMmPerM * message.start_depth,
          kMmPerM * message.sample_spacing};
}

void validate(const msg::PreScanFrame& message, const std::string& source) {
  require_size({{"samples", message.samples}, {"lines", message.lines}}, message.data.size(),
               source);
  // One frame is a tracked sweep of one frame: the same checks hold.
  ScanGeometry geometry;
  geometry.axial = axial_from_message(message.geometry, message.samples, source);
  geometry.array = array_from_message(message.geometry, source);
  geometry.motion = TrackedSweep{{Eigen::Isometry3d::Identity()}, {}};
  geometry.validate(source);
  require_count("geometry: lines", line_table(geometry.array).size(), message.lines, source);
  require(std::isfinite(message.motor_angle) && std::isfinite(message.motor_travel), source,
          "'motor_angle' and 'motor_travel' must be finite");
  if (is_motorised(message.geometry)) {
    require_unused("pose_frame_id", message.pose_frame_id.empty(), source);
    require(message.geometry.motor_radius > 0.0, source,
            "'geometry.motor_radius' is " + std::to_string(message.geometry.motor_radius) +
                ", must be > 0");
  } else {
    require_unused("motor_angle", message.motor_angle == 0.0, source);
    require_unused("motor_travel", message.motor_travel == 0.0, source);
    if (!message.pose_frame_id.empty()) from_message_mm(message.pose, source + ": 'pose'");
  }
}

std::uint32_t data_checksum(const std::vector<std::uint8_t>& data) { return checksum(data); }

msg::PreScanVolume to_message(const PreScanVolume& volume, const std_msgs::Header& header) {
  volume.validate("pre-scan volume");
  msg::PreScanVolume message;
  message.header = header;
  message.geometry = to_probe_message(volume.geometry);
  message.samples = static_cast<std::uint32_t>(volume.geometry.samples());
  message.lines = static_cast<std::uint32_t>(volume.geometry.lines());
  message.frames = static_cast<std::uint32_t>(volume.geometry.frames());
  if (const auto* motor = std::get_if<MotorSweep>(&volume.geometry.motion)) {
    message.frame_angles = motor->frame_angles_rad;
    message.frame_travel = motor->frame_travel_rad;
  } else {
    const auto& tracked = std::get<TrackedSweep>(volume.geometry.motion);
    for (const Eigen::Isometry3d& T : tracked.T_us_frame)
      message.frame_poses.push_back(to_pose_message(T));
    // The header's stamp is the end of the acquisition.
    for (const double time_s : tracked.frame_times_s)
      message.frame_stamps.push_back(header.stamp +
                                     ::ros::Duration(time_s - tracked.frame_times_s.back()));
  }
  message.data = volume.voxels;
  message.crc32 = checksum(message.data);
  return message;
}

PreScanVolume from_message(const msg::PreScanVolume& message, const std::string& source) {
  require_size({{"samples", message.samples}, {"lines", message.lines}, {"frames", message.frames}},
               message.data.size(), source);
  PreScanVolume volume;
  ScanGeometry& geometry = volume.geometry;
  geometry.axial = axial_from_message(message.geometry, message.samples, source);
  geometry.array = array_from_message(message.geometry, source);
  require_count("geometry: lines", line_table(geometry.array).size(), message.lines, source);
  if (!message.frame_stamps.empty())
    require_count("frame_stamps", message.frame_stamps.size(), message.frames, source);
  if (is_motorised(message.geometry)) {
    require_unused("frame_poses", message.frame_poses.empty(), source);
    require_count("frame_angles", message.frame_angles.size(), message.frames, source);
    geometry.motion = MotorSweep{kMmPerM * message.geometry.motor_radius, message.frame_angles,
                                 message.frame_travel};
  } else {
    require_unused("frame_angles", message.frame_angles.empty(), source);
    require_unused("frame_travel", message.frame_travel == 0.0, source);
    require_count("frame_poses", message.frame_poses.size(), message.frames, source);
    TrackedSweep tracked;
    for (std::size_t i = 0; i < message.frame_poses.size(); ++i)
      tracked.T_us_frame.push_back(from_message_mm(
          message.frame_poses[i], source + ": 'frame_poses[" + std::to_string(i) + "]'"));
    for (std::size_t i = 0; i < message.frame_stamps.size(); ++i)
      tracked.frame_times_s.push_back(seconds_since_first(message.frame_stamps, i));
    geometry.motion = std::move(tracked);
  }
  geometry.validate(source);
  require_checksum(message.data, message.crc32, source);
  volume.voxels = message.data;
  return volume;
}

msg::CtVolume to_message(const CtVolume& ct, const std_msgs::Header& header, unsigned revision) {
  ct.grid.validate("CT");
  msg::CtVolume message;
  message.header = header;
  message.revision = revision;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    message.size[i] = static_cast<std::uint32_t>(ct.grid.size[axis]);
    message.spacing[i] = ct.grid.spacing_mm[axis] / kMmPerM;
    for (int column = 0; column < 3; ++column)
      message.direction[3 * i + static_cast<std::size_t>(column)] = ct.grid.direction(axis, column);
  }
  message.origin = to_message(ct.grid.origin_mm);
  message.data = ct.voxels;
  message.crc32 = checksum(message.data);
  return message;
}

CtVolume from_message(const msg::CtVolume& message, const std::string& source) {
  require_size(
      {{"size[0]", message.size[0]}, {"size[1]", message.size[1]}, {"size[2]", message.size[2]}},
      message.data.size(), source);
  CtVolume ct;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    ct.grid.size[axis] = static_cast<int>(message.size[i]);
    ct.grid.spacing_mm[axis] = kMmPerM * message.spacing[i];
    for (int column = 0; column < 3; ++column)
      ct.grid.direction(axis, column) = message.direction[3 * i + static_cast<std::size_t>(column)];
  }
  ct.grid.origin_mm = point_from_message_mm(message.origin);
  ct.grid.validate(source);
  require_checksum(message.data, message.crc32, source);
  ct.voxels = message.data;
  return ct;
}

namespace {

std::uint8_t status_code(RegistrationStatus status) {
  switch (status) {
    case RegistrationStatus::kFailed:
      return msg::StatusCode::FAILED;
    case RegistrationStatus::kRegistered:
      return msg::StatusCode::REGISTERED;
    case RegistrationStatus::kLowConfidence:
      return msg::StatusCode::LOW_CONFIDENCE;
    case RegistrationStatus::kNoOverlap:
      return msg::StatusCode::NO_OVERLAP;
    case RegistrationStatus::kCancelled:
      return msg::StatusCode::CANCELLED;
  }
  return msg::StatusCode::FAILED;
}

std::vector<msg::Measure> to_messages(const std::map<std::string, double>& numbers) {
  std::vector<msg::Measure> messages;
  for (const auto& [name, value] : numbers) {
    msg::Measure measure;
    measure.name = name;
    measure.value = value;
    messages.push_back(measure);
  }
  return messages;
}

/// From (rotation, translation) in rad and mm to (translation, rotation) in m and rad.
void fill_covariance(const Eigen::Matrix<double, 6, 6>& core, msg::RegistrationResult& message) {
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column) {
      const double unit = (row < 3 ? kMmPerM : 1.0) * (column < 3 ? kMmPerM : 1.0);
      message.covariance[static_cast<std::size_t>(6 * row + column)] =
          core((row + 3) % 6, (column + 3) % 6) / unit;
    }
}

}  // namespace

msg::RegistrationResult to_message(const RegistrationResult& result) {
  msg::RegistrationResult message;
  message.status.code = status_code(result.status);
  message.status.message = result.message;
  if (result.T_us_ct) message.transform = to_message(*result.T_us_ct);
  message.expected_error = std::numeric_limits<double>::quiet_NaN();
  if (result.covariance) fill_covariance(*result.covariance, message);
  if (result.measures.expected_error_mm)
    message.expected_error = *result.measures.expected_error_mm / kMmPerM;
  message.similarity = result.similarity;
  message.overlap = result.overlap;
  for (const RegistrationCandidate& candidate : result.candidates) {
    msg::RegistrationCandidate one;
    one.transform = to_message(candidate.T_us_ct);
    one.similarity = candidate.similarity;
    one.overlap = candidate.overlap;
    message.candidates.push_back(one);
  }
  message.measures = to_messages(by_name(result.measures));
  message.durations = to_messages(result.seconds);
  message.evaluations = static_cast<std::uint32_t>(result.evaluations);
  message.version = result.version;
  return message;
}

}  // namespace usct::ros_interface
