#pragma once

#include <ros/time.h>
#include <us_ct_registration/PreScanVolume.h>

#include <memory>
#include <string>
#include <vector>

#include "ros/fusion/fusion_scene.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {

struct UltrasoundPlacerOptions {
  /// Empty: the ultrasound's frame.
  std::string fixed_frame;
  /// Longest wait for tf, by the wall clock.
  double tf_timeout_s = 1.0;
};

/// Looks ultrasound up in tf, and sets its frames where the probe was at their stamps. Frames may
/// be connected after the ultrasound has come, so that the newest one is placed again once tf can.
/// Not synchronised.
class UltrasoundPlacer {
 public:
  /// `tf` must outlive this object.
  UltrasoundPlacer(const TfBuffer& tf, UltrasoundPlacerOptions options)
      : tf_(tf), options_(std::move(options)) {}

  /// The ultrasound of a message, with a warning if tf does not place it within `tf_timeout_s`.
  /// Throws InputError if the message is not valid.
  std::shared_ptr<const FusionUltrasound> take(const us_ct_registration::PreScanVolume& message);
  /// The newest ultrasound with what tf has come to know of its place; null if there is nothing
  /// new. Does not wait, and only asks tf if there is nothing new.
  std::shared_ptr<const FusionUltrasound> place_again();

 private:
  void place(FusionUltrasound& us, double tf_wait_s) const;
  bool is_known(const FusionUltrasound& us, const ::ros::Time& stamp) const;

  const TfBuffer& tf_;
  const UltrasoundPlacerOptions options_;
  /// The newest ultrasound if tf does not place it yet; its geometry is as it was recorded.
  std::shared_ptr<const FusionUltrasound> unplaced_;
  std::vector<::ros::Time> frame_stamps_;  // of the newest ultrasound
};

}  // namespace usct::ros_interface
