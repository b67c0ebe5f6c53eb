#pragma once

#include <geometry_msgs/Pose.h>
#include <us_ct_registration/PreScanFrame.h>
#include <us_ct_registration/PreScanVolume.h>

#include <memory>
#include <string>

#include "us_ct_registration/ultrasound/streamed_frame.h"
#include "us_ct_registration/ultrasound/sweep_assembly.h"

namespace usct::ros_interface {

/// A frame of a stream with its message. The brightness is that of the message, not a copy. The
/// message's numbers, in metres, are copied unchanged into the message of the volume, because
/// scaling to millimetres and back may change the last bit.
struct ReceivedFrame : StreamedFrame {
  us_ct_registration::PreScanFrame::ConstPtr message;
  /// The frame's `pose`, if it has one, m.
  geometry_msgs::Pose pose_m;

  /// Takes the pose that was looked up for the frame's stamp minus the image lag. Throws InputError
  /// if it is not rigid.
  void set_looked_up(const geometry_msgs::Pose& looked_up_m, const std::string& us_frame_id);
  /// Whether the pose is known only after a look-up.
  bool needs_pose() const { return !is_motorised() && !pose; }
};

/// Throws InputError, naming the frame, for sizes that do not fit the data, for fields that the
/// type of probe does not have, and for a pose that is not rigid. StreamedFrame::validate checks
/// the rest.
std::shared_ptr<ReceivedFrame> from_message(
    const us_ct_registration::PreScanFrame::ConstPtr& message);

/// The message of any sweep.
us_ct_registration::PreScanVolumePtr volume_message(const AssembledSweep& sweep);

/// The same with the unchanged numbers of its frames' messages. All frames of the sweep must be
/// ReceivedFrames.
us_ct_registration::PreScanVolumePtr to_message(const AssembledSweep& sweep);

}  // namespace usct::ros_interface
