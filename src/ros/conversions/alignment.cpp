#include "ros/conversions/alignment.h"

#include <ros/serialization.h>
#include <zlib.h>

#include <cmath>
#include <limits>

#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/node/status.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/rigid.h"
#include "us_ct_registration/registration/confidence_text.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

std::uint32_t digest_of(msg::RegistrationResult message) {
  message.header.seq = 0;
  const ::ros::SerializedMessage bytes = ::ros::serialization::serializeMessage(message);
  return static_cast<std::uint32_t>(crc32_z(0, bytes.buf.get(), bytes.num_bytes));
}

MetricPose pose_from(const geometry_msgs::Transform& transform) {
  const auto& t = transform.translation;
  const auto& q = transform.rotation;
  return {{t.x, t.y, t.z}, {q.w, q.x, q.y, q.z}};
}

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// The result states the covariance of a small motion (translation d, rotation r) about the origin
/// of the ultrasound's frame, in that frame's axes. The CT's origin p then moves by d + r x p; with
/// the rotation R from the ultrasound's axes to those of the fixed frame, the motion is
/// (R (d + r x p), R r). Zero, which means unknown, if anything is not a number.
Matrix6d covariance_in_fixed_frame(const msg::RegistrationResult& message) {
  const Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> in_us(
      message.covariance.data());
  const MetricPose us_ct = pose_from(message.transform);
  const MetricPose fixed_ct = pose_from(message.fixed_transform);
  const Eigen::Matrix3d R = fixed_ct.rotation.normalized().toRotationMatrix() *
                            us_ct.rotation.normalized().toRotationMatrix().transpose();
  Matrix6d motion = Matrix6d::Zero();
  motion.topLeftCorner<3, 3>() = R;
  motion.topRightCorner<3, 3>() = -R * cross_matrix(us_ct.translation_m);
  motion.bottomRightCorner<3, 3>() = R;
  const Matrix6d turned = motion * in_us * motion.transpose();
  return turned.allFinite() ? turned : Matrix6d::Zero();
}

std_msgs::Header header_of(const Alignment& alignment) {
  std_msgs::Header header;
  header.stamp = time_from(alignment.us_stamp_ns);
  header.frame_id = alignment.fixed_frame;
  return header;
}

void set_alignment(const Alignment& alignment, msg::Alignment& message) {
  message.header = header_of(alignment);
  message.ct_frame = alignment.ct_frame;
  message.transform = to_message(alignment.T_fixed_ct);
  message.result_id = alignment.result_id;
  message.ct_crc32 = alignment.ct_crc32;
  message.expected_error = alignment.expected_error_m;
}

std::uint8_t status_code(DecisionAnswer::Code code) {
  switch (code) {
    case DecisionAnswer::Code::kDone:
      return msg::StatusCode::OK;
    case DecisionAnswer::Code::kNotRegistered:
      return msg::StatusCode::FAILED;
    case DecisionAnswer::Code::kInvalidResult:
      return msg::StatusCode::INVALID_MESSAGE;
    case DecisionAnswer::Code::kInvalidRequest:
      return msg::StatusCode::INVALID_REQUEST;
    case DecisionAnswer::Code::kNothingToDecide:
      return msg::StatusCode::NOTHING_TO_DECIDE;
  }
  return msg::StatusCode::FAILED;
}

}  // namespace

OfferedResult from_message(const msg::RegistrationResult& message) {
  OfferedResult result;
  result.registered = message.status.code == msg::StatusCode::REGISTERED;
  result.message = message.status.message;
  result.digest = digest_of(message);
  Alignment& alignment = result.alignment;
  alignment.fixed_frame = message.fixed_frame;
  alignment.ct_frame = message.ct_frame;
  alignment.T_fixed_ct = pose_from(message.fixed_transform);
  alignment.result_id = message.id;
  alignment.ct_crc32 = message.ct_crc32;
  alignment.us_stamp_ns = nanoseconds_from(message.header.stamp);
  alignment.expected_error_m = message.expected_error;
  if (result.registered) alignment.covariance = covariance_in_fixed_frame(message);
  return result;
}

msg::Alignment to_message(const AlignmentState& state) {
  msg::Alignment message;
  message.message = state.message;
  message.waiting_id = state.waiting_id;
  if (!state.broadcast) {
    message.expected_error = std::numeric_limits<double>::quiet_NaN();
    return message;
  }
  set_alignment(*state.broadcast, message);
  message.state = state.broadcast->restored ? msg::Alignment::RESTORED : msg::Alignment::ACCEPTED;
  message.accepted = time_from(state.broadcast->accepted_ns);
  return message;
}

msg::Alignment to_proposed_message(const AlignmentState& state) {
  msg::Alignment message;
  message.waiting_id = state.waiting_id;
  if (!state.proposed) {
    message.expected_error = std::numeric_limits<double>::quiet_NaN();
    message.message = "nothing waits for accept";
    return message;
  }
  set_alignment(*state.proposed, message);
  message.state = msg::Alignment::PROPOSED;
  message.message =
      (state.proposed->restored ? "the alignment from before the restart (" +
                                      std::to_string(AlignmentDecisions::kKept) + ")"
                                : "result " + std::to_string(state.proposed->result_id)) +
      " waits for accept or reject";
  return message;
}

geometry_msgs::TransformStamped to_transform_message(const Alignment& alignment) {
  geometry_msgs::TransformStamped message;
  message.header = header_of(alignment);
  message.child_frame_id = alignment.ct_frame;
  message.transform = to_message(alignment.T_fixed_ct);
  return message;
}

std::optional<geometry_msgs::PoseWithCovarianceStamped> to_pose_message(
    const Alignment& alignment) {
  if (alignment.covariance.isZero(0.0)) return std::nullopt;
  const geometry_msgs::Transform transform = to_message(alignment.T_fixed_ct);
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header = header_of(alignment);
  message.pose.pose.position.x = transform.translation.x;
  message.pose.pose.position.y = transform.translation.y;
  message.pose.pose.position.z = transform.translation.z;
  message.pose.pose.orientation = transform.rotation;
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message.pose.covariance.data()) =
      alignment.covariance;
  return message;
}

msg::StatusCode to_message(const DecisionAnswer& answer) {
  return status(status_code(answer.code), answer.message);
}

geometry_msgs::Transform to_message(const MetricPose& pose) {
  geometry_msgs::Transform transform;
  transform.translation.x = pose.translation_m.x();
  transform.translation.y = pose.translation_m.y();
  transform.translation.z = pose.translation_m.z();
  transform.rotation.w = pose.rotation.w();
  transform.rotation.x = pose.rotation.x();
  transform.rotation.y = pose.rotation.y();
  transform.rotation.z = pose.rotation.z();
  return transform;
}

std::optional<Eigen::Isometry3d> T_fixed_ct_from(const msg::Alignment& message) {
  if (message.state == msg::Alignment::NONE) return std::nullopt;
  return from_message_mm(message.transform, "registration/alignment");
}

std::string evidence_of(const msg::Alignment& alignment, const RegistrationResult* result) {
  if (result != nullptr) return confidence_text(*result) + evidence_text(result->measures);
  if (!std::isfinite(alignment.expected_error)) return "expected error: not known\n";
  return formatted("expected error: %.2f mm\n", kMmPerM * alignment.expected_error);
}

}  // namespace usct::ros_interface
