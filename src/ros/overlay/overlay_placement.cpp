#include "ros/overlay/overlay_placement.h"

#include <us_ct_registration/StatusCode.h>

#include "ros/alignment/alignment_watch.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/node/refusal.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_wait.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using Code = us_ct_registration::StatusCode;

}  // namespace

Eigen::Isometry3d T_frame_ct_at(const TfBuffer& tf, const OverlayScene& scene,
                                const std::string& frame, const ::ros::Time& stamp,
                                const ::ros::Time& now, double timeout_s) try {
  if (stamp.isZero()) throw Refusal(Code::INVALID_MESSAGE, "there is no stamp");
  if (frame.empty()) throw Refusal(Code::INVALID_MESSAGE, "there is no frame_id");
  require_not_ahead(stamp, now, "'" + frame + "'", "header.stamp");
  wait_for_transform(tf, frame, scene.ct_frame, stamp, timeout_s);
  const Eigen::Isometry3d T_fixed_ct =
      T_fixed_ct_in_tf(tf, {scene.fixed_frame, scene.ct_frame, scene.T_fixed_ct}, stamp);
  return from_message_mm(tf.look_up(frame, scene.fixed_frame, stamp).transform, "tf") * T_fixed_ct;
} catch (const Refusal&) {
  throw;
} catch (const InputError& error) {
  throw Refusal(Code::INVALID_MESSAGE, error.what());
} catch (const std::exception& error) {
  throw Refusal(Code::TF_UNAVAILABLE, error.what());
}

}  // namespace usct::ros_interface
