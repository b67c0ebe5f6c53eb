#pragma once

#include <ros/time.h>
#include <us_ct_registration/CtVolume.h>
#include <us_ct_registration/PreScanVolume.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "ros/bags/endoscope_video.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

/// Writes files into a bag as an operating room would have recorded them, and reads such bags.
/// docs/bags.md has the topics.
namespace usct::ros_interface {

/// A sweep to write, with the known transforms.
struct BagAcquisition {
  PreScanVolume us;
  /// Pose of the US frame during the sweep: p_fixed = T p_us, mm. Without it no tf is written.
  std::optional<Eigen::Isometry3d> T_fixed_us;
  /// The truth, for tests: p_us = T p_ct, mm.
  std::optional<Eigen::Isometry3d> T_us_ct;
};

struct BagOptions {
  /// Stamp of the first frame; at least 3 s after the epoch, because the robot arrives before it.
  ::ros::Time start;
  /// Frame rate of motorised sweeps, and of tracked sweeps whose frames have no times; > 0.
  double frame_rate_hz = 20.0;
  /// Time from the last frame of a sweep to the first of the next; >= 3.
  double pause_s = 6.0;
  /// Distance by which the probe is retracted along its axis between and after sweeps; >= 0. 0: it
  /// is not moved.
  double retract_mm = 100.0;
  /// Tracked sweeps: poses go to tf (US frame -> array frame) instead of the frames' messages.
  bool poses_in_tf = false;
  std::string fixed_frame = "patient";
  std::string us_frame = "us";
  /// Tracked sweeps: the frame that moves with the array.
  std::string array_frame = "us_array";
  std::string ct_frame = "ct";
  /// Time from the last frame of the last sweep to the first image of the endoscope; >= 1.
  double endoscope_delay_s = 10.0;
  EndoscopeFrames endoscope_frames;

  /// Throws InputError that names the option, its value and the constraint.
  void validate() const;
};

/// The CT of a bag: its voxels (`ct/volume`), or only its path (`ct/path`), or neither.
struct BagCt {
  std::optional<CtVolume> volume;
  std::string path;
};

/// Writes a bag, atomically. Throws InputError for invalid volumes or options, for acquisitions of
/// which only some have a T_fixed_us, for an endoscope without T_fixed_us and T_us_ct of the last
/// acquisition, where the anatomy that it saw was, and for a folder that cannot be written to.
void write_acquisition_bag(const std::vector<BagAcquisition>& acquisitions, const BagCt& ct,
                           const BagOptions& options, const std::filesystem::path& path,
                           const std::optional<EndoscopeVideo>& endoscope = {});

/// Callbacks for the sweeps and CTs of a bag, in the order of recording; `us` and `ct` may be
/// empty.
struct BagVisitor {
  std::function<void(const us_ct_registration::PreScanVolume&)> us;
  std::function<void(const us_ct_registration::CtVolume&)> ct;
  /// Receives a message about data that could not be used, such as frames of an incomplete sweep.
  /// Must be set.
  std::function<void(const std::string&)> warning;
  /// The US frame, in which tf has the poses of frames that carry none. Empty: that from which the
  /// frames' array hangs, which must move in it.
  std::string pose_frame;
};

/// Reads a bag and calls the visitor. Messages are found by their type, not by their topic: the
/// volumes if there are any, else sweeps assembled from frames, with poses from the bag's tf if the
/// frames carry none. Throws InputError if the file is no bag or a damaged one, or if several
/// topics have messages of one type (`rosbag filter` can keep the intended one).
void visit_acquisition_bag(const std::filesystem::path& path, const BagVisitor& visitor);

/// The reason why a file is no bag that can be read, of which rosbag says `error`.
std::string words_for_bad_bag(const std::filesystem::path& path, const std::string& error);

}  // namespace usct::ros_interface
