#include "ros/fusion/ultrasound_placer.h"

#include <algorithm>

#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "ros/tf/fixed_frame.h"
#include "ros/tf/tf_wait.h"
#include "us_ct_registration/geometry/probe_motion.h"

namespace usct::ros_interface {

void UltrasoundPlacer::place(FusionUltrasound& us, double tf_wait_s) const try {
  constexpr double kStillMm = 0.1;
  us.warning.clear();
  us.T_fixed_us = from_message_mm(
      wait_for_transform(tf_, us.fixed_frame, us.header.frame_id, us.header.stamp, tf_wait_s)
          .transform,
      "tf");
  if (frame_stamps_.empty()) return;
  FixedFrameOptions options;
  options.frame = us.fixed_frame;
  const std::vector<Eigen::Isometry3d> T_us_then =
      FixedFrame(tf_, options).T_us_then(us.header, {*us.T_fixed_us, 0.0}, frame_stamps_);
  ScanGeometry& geometry = us.volume.geometry;
  if (probe_motion_mm(beam_grid(geometry), T_us_then) > kStillMm)
    geometry = follow_probe(T_us_then, geometry);
} catch (const std::exception& error) {
  us.warning =
      "WARNING: the pose of the probe is not known, a motion during the sweep would not be "
      "seen: " +
      std::string(error.what());
}

std::shared_ptr<const FusionUltrasound> UltrasoundPlacer::take(
    const us_ct_registration::PreScanVolume& message) {
  auto us = std::make_shared<FusionUltrasound>();
  us->header = message.header;
  us->volume = from_message(message, "us/volume");
  us->fixed_frame = options_.fixed_frame.empty() ? message.header.frame_id : options_.fixed_frame;
  frame_stamps_ = message.frame_stamps;
  if (us->fixed_frame == us->header.frame_id)
    us->T_fixed_us = Eigen::Isometry3d::Identity();
  else
    place(*us, options_.tf_timeout_s);
  unplaced_ = us->warning.empty() ? nullptr : us;
  return us;
}

bool UltrasoundPlacer::is_known(const FusionUltrasound& us, const ::ros::Time& stamp) const {
  return tf_.can_transform(us.fixed_frame, us.header.frame_id, stamp);
}

std::shared_ptr<const FusionUltrasound> UltrasoundPlacer::place_again() {
  if (!unplaced_ || !is_known(*unplaced_, unplaced_->header.stamp)) return nullptr;
  const bool is_complete =
      std::all_of(frame_stamps_.begin(), frame_stamps_.end(),
                  [&](const ::ros::Time& stamp) { return is_known(*unplaced_, stamp); });
  if (unplaced_->T_fixed_us && !is_complete) return nullptr;
  auto us = std::make_shared<FusionUltrasound>(*unplaced_);
  place(*us, 0.0);
  // If the frames cannot be placed although tf knows them all, a further attempt would be in vain.
  unplaced_ = us->warning.empty() || is_complete ? nullptr : us;
  return us;
}

}  // namespace usct::ros_interface
