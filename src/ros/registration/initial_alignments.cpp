#include "ros/registration/initial_alignments.h"

#include "ros/conversions/poses.h"
#include "ros/node/refusal.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Status = msg::StatusCode;
using Eigen::Isometry3d;
using SetRequest = msg::SetInitialAlignment::Request;

std::vector<Eigen::Vector3d> points_mm(const std::vector<geometry_msgs::Point>& points) {
  std::vector<Eigen::Vector3d> result;
  for (const geometry_msgs::Point& point : points) result.push_back(point_from_message_mm(point));
  return result;
}

/// The alignment of a request, in the request's frame.
LandmarkAlignment alignment_of(const SetRequest& request) {
  try {
    if (request.type == SetRequest::POSE)
      return {from_message_mm(request.transform, "'transform'"), 0.0};
    if (request.type == SetRequest::LANDMARKS)
      return align_landmarks(points_mm(request.points), points_mm(request.points_ct));
  } catch (const InputError& error) {
    throw Refusal(Status::INVALID_REQUEST, error.what());
  }
  throw Refusal(Status::INVALID_REQUEST, "'type' is " + std::to_string(request.type) +
                                             ", must be 1 (POSE), 2 (LANDMARKS) or 3 (CLEAR)");
}

Isometry3d transform_mm(const geometry_msgs::Transform& transform, const std::string& source,
                        std::uint8_t code) {
  try {
    return from_message_mm(transform, source);
  } catch (const InputError& error) {
    throw Refusal(code, error.what());
  }
}

}  // namespace

InitialAlignments::InitialAlignments(const FixedFrame& frame,
                                     std::optional<FramedAlignment> from_parameters)
    : frame_(frame), from_parameters_(std::move(from_parameters)) {}

double InitialAlignments::set(
    const SetRequest& request, const std::optional<CtIdentity>& ct,
    const std::function<std::shared_ptr<const HeldUltrasound>()>& newest) {
  std::optional<FramedAlignment> anchored;
  double residual_m = 0.0;
  if (request.type != SetRequest::CLEAR) {
    const LandmarkAlignment given = alignment_of(request);
    residual_m = given.residual_mm / kMmPerM;
    const std::string& frame = request.header.frame_id;
    if (frame_.is_fixed(frame)) {
      anchored = FramedAlignment{frame, given.T_target_source};
    } else {
      const std::shared_ptr<const HeldUltrasound> us = newest();
      const Isometry3d T_us_frame = frame_.T_us_frame(us->header, us->pose, frame);
      anchored = FramedAlignment{frame_.name(us->header),
                                 us->pose.T_fixed_us * T_us_frame * given.T_target_source};
    }
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  set_ = anchored;
  set_for_ = ct;
  used_since_ms_.reset();
  return residual_m;
}

void InitialAlignments::arrived(const msg::Alignment::ConstPtr& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  accepted_ = message;
  if (message->state == msg::Alignment::ACCEPTED && used_since_ms_ &&
      message->result_id > *used_since_ms_)
    set_.reset();
}

bool InitialAlignments::has_accepted(const CtIdentity& ct) const {
  return accepted_ && accepted_->state != msg::Alignment::NONE &&
         CtIdentity(accepted_->ct_frame, accepted_->ct_crc32) == ct;
}

bool InitialAlignments::is_in_force(const ::ros::Time& us_stamp, const CtIdentity& ct) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return has_accepted(ct) && accepted_->header.stamp == us_stamp;
}

std::string InitialAlignments::policy() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return accepted_ ? accepted_->policy : "";
}

InitialAlignment InitialAlignments::in_ultrasound(const FramedAlignment& alignment,
                                                  const HeldUltrasound& us,
                                                  const std::string& source) const {
  return {frame_.T_us_frame(us.header, us.pose, alignment.frame) * alignment.T_frame_ct, source};
}

std::optional<InitialAlignment> InitialAlignments::accepted(const HeldUltrasound& us,
                                                            const HeldCt& ct) const {
  if (!has_accepted(identity_of(ct))) return std::nullopt;
  const Isometry3d T = transform_mm(accepted_->transform, "accepted alignment: 'transform'",
                                    Status::INVALID_MESSAGE);
  return in_ultrasound({accepted_->header.frame_id, T}, us,
                       accepted_->state == msg::Alignment::RESTORED ? "restored" : kAccepted);
}

std::optional<InitialAlignment> InitialAlignments::choose(
    const std::optional<geometry_msgs::TransformStamped>& of_goal, const HeldUltrasound& us,
    const HeldCt& ct, std::uint64_t now_ms) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!used_since_ms_) used_since_ms_ = now_ms;
  }
  if (of_goal) {
    const Isometry3d T =
        transform_mm(of_goal->transform, "goal: 'initial.transform'", Status::INVALID_REQUEST);
    return in_ultrasound({of_goal->header.frame_id, T}, us, "goal");
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (set_ && !set_for_) set_for_ = identity_of(ct);
  if (set_ && set_for_ == identity_of(ct)) return in_ultrasound(*set_, us, "set");
  if (const auto alignment = accepted(us, ct)) return alignment;
  if (from_parameters_) return in_ultrasound(*from_parameters_, us, "parameters");
  return std::nullopt;
}

}  // namespace usct::ros_interface
