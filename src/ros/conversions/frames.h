#pragma once

#include <geometry_msgs/Pose.h>
#include <us_ct_registration/PreScanFrame.h>
#include <us_ct_registration/PreScanVolume.h>

#include <memory>
#include <string>

#include "us_ct_registration/ultrasound/streamed_frame.h"
#include "us_ct_registration/ultrasound/sweep_assembly.h"

namespace usct::ros_interface {

/// A frame of a stream and the message that it came as. The brightness is the message's own; the
/// message's numbers, which are in metres, go on unchanged into the message of the volume: scaling
/// to millimetres and back may change the last bit.
struct ReceivedFrame : StreamedFrame {
  us_ct_registration::PreScanFrame::ConstPtr message;
  /// The frame's `pose`, if it has one, m.
  geometry_msgs::Pose pose_m;

  /// Takes the pose that was looked up for the frame's stamp minus the image lag. Throws InputError
  /// if it is not rigid.
  void set_looked_up(const geometry_msgs::Pose& looked_up_m, const std::string& us_frame_id);
  /// Whether only a look-up can tell the pose.
  bool needs_pose() const { return !is_motorised() && !pose; }
};

/// Throws InputError, naming the frame, for sizes that do not fit the data, for fields that the
/// type of probe does not have, and for a pose that is not rigid. StreamedFrame::validate checks
/// the rest.
std::shared_ptr<ReceivedFrame> from_message(
    const us_ct_registration::PreScanFrame::ConstPtr& message);

/// All frames of the sweep must be ReceivedFrames.
us_ct_registration::PreScanVolumePtr to_message(const AssembledSweep& sweep);

}  // namespace usct::ros_interface
