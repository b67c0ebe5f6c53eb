#pragma once

#include <ros/duration.h>
#include <us_ct_registration/PreScanFrame.h>
#include <us_ct_registration/PreScanVolume.h>

#include <cstdint>
#include <string>
#include <vector>

namespace usct::ros_interface {

/// Options for cutting a volume into frames.
struct FrameStream {
  std::uint32_t sweep = 0;
  /// Time from frame to frame, for volumes without `frame_stamps`. The last frame then has the
  /// volume's stamp.
  ::ros::Duration frame_period{0.05};
  /// Tracked volumes: name of the frame that moves with the array, which becomes the frames'
  /// `header.frame_id`. The frames carry their poses in the volume's frame (`pose_frame_id`).
  std::string array_frame_id = "us_array";
};

/// The frames of a volume as a scanner would have streamed them, in order. us_ingest assembles them
/// to the same volume, bit by bit. Throws InputError for an invalid volume, and for a
/// first stamp before the epoch.
std::vector<us_ct_registration::PreScanFrame> frames_of(
    const us_ct_registration::PreScanVolume& volume, const FrameStream& stream);

}  // namespace usct::ros_interface
