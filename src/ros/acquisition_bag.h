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

#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

/// Bags of acquisitions: what an operating room would have recorded, made of files, and the way
/// back. docs/bags.md has the topics.
namespace usct::ros_interface {

/// One sweep to write, and what is known about it.
struct BagAcquisition {
  PreScanVolume us;
  /// Where the US frame was during the sweep: p_fixed = T p_us, mm. Without it no tf is written.
  std::optional<Eigen::Isometry3d> T_fixed_us;
  /// The truth, for tests: p_us = T p_ct, mm.
  std::optional<Eigen::Isometry3d> T_us_ct;
};

struct BagOptions {
  /// Stamp of the first frame; at least 3 s after the epoch, because the robot arrives before it.
  ::ros::Time start;
  /// Of motorised sweeps, and of tracked ones whose frames have no times; > 0.
  double frame_rate_hz = 20.0;
  /// From the last frame of a sweep to the first of the next; >= 3.
  double pause_s = 6.0;
  /// How far the probe moves away along its axis between and after sweeps; >= 0. 0: it stays.
  double retract_mm = 100.0;
  /// Tracked sweeps: poses go to tf (US frame -> array frame) instead of the frames' messages.
  bool poses_in_tf = false;
  std::string fixed_frame = "patient";
  std::string us_frame = "us";
  /// Tracked sweeps: what moves with the array.
  std::string array_frame = "us_array";
  std::string ct_frame = "ct";

  /// Throws InputError that names the option, its value and the constraint.
  void validate() const;
};

/// The CT of a bag: voxels (`ct/volume`), or only where it is (`ct/path`), or neither.
struct BagCt {
  std::optional<CtVolume> volume;
  std::string path;
};

/// Writes a bag, atomically. Throws InputError for invalid volumes or options, for acquisitions of
/// which only some have a T_fixed_us, and for a folder that cannot be written to.
void write_acquisition_bag(const std::vector<BagAcquisition>& acquisitions, const BagCt& ct,
                           const BagOptions& options, const std::filesystem::path& path);

/// What to do with the sweeps and CTs of a bag, in the order of recording.
struct BagVisitor {
  std::function<void(const us_ct_registration::PreScanVolume&)> us;
  std::function<void(const us_ct_registration::CtVolume&)> ct;
  /// What could not be used, and why: frames of a sweep that is not whole, for example.
  std::function<void(const std::string&)> warning;
};

/// Visits what a bag holds, found by the type of the messages, whatever their topics are called:
/// volumes if there are any, else sweeps assembled from frames, with poses from the bag's tf if the
/// frames carry none. Throws InputError if it is no bag, or a damaged one, or if several topics
/// have messages of one type (`rosbag filter` keeps the one that is meant).
void visit_acquisition_bag(const std::filesystem::path& path, const BagVisitor& visitor);

}  // namespace usct::ros_interface
