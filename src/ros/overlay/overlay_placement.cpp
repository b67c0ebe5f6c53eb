#include "ros/overlay/overlay_placement.h"

#include <us_ct_registration/StatusCode.h>

#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/refusal.h"
#include "ros/tf_buffer.h"
#include "ros/tf_wait.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using Code = us_ct_registration::StatusCode;

Eigen::Isometry3d look_up(const TfBuffer& tf, const std::string& target, const std::string& source,
                          const ::ros::Time& stamp) {
  return from_message_mm(tf.look_up(target, source, stamp).transform, "tf");
}

}  // namespace

Eigen::Isometry3d T_frame_ct_at(const TfBuffer& tf, const OverlayScene& scene,
                                const std::string& frame, const ::ros::Time& stamp,
                                const ::ros::Time& now, double timeout_s) try {
  constexpr double kSameMm = 1e-3;
  constexpr double kSameRad = 1e-6;
  if (stamp.isZero()) throw Refusal(Code::INVALID_MESSAGE, "there is no stamp");
  if (frame.empty()) throw Refusal(Code::INVALID_MESSAGE, "there is no frame_id");
  require_not_ahead(stamp, now, "'" + frame + "'", "header.stamp");
  wait_for_transform(tf, frame, scene.ct_frame, stamp, timeout_s);
  const Eigen::Isometry3d T_fixed_ct = look_up(tf, scene.fixed_frame, scene.ct_frame, stamp);
  const Eigen::Isometry3d difference = scene.T_fixed_ct.inverse() * T_fixed_ct;
  if (difference.translation().norm() > kSameMm ||
      Eigen::AngleAxisd(difference.linear()).angle() > kSameRad)
    throw Refusal(Code::TF_STALE, "at the stamp " + seconds_text(stamp) +
                                      " tf has the CT where another alignment has it");
  return look_up(tf, frame, scene.fixed_frame, stamp) * T_fixed_ct;
} catch (const Refusal&) {
  throw;
} catch (const InputError& error) {
  throw Refusal(Code::INVALID_MESSAGE, error.what());
} catch (const std::exception& error) {
  throw Refusal(Code::TF_UNAVAILABLE, error.what());
}

}  // namespace usct::ros_interface
