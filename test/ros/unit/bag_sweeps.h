#pragma once

#include "ros/bags/acquisition_bag.h"

/// Small sweeps to be written into bags.
namespace usct::ros_interface {

inline Eigen::Isometry3d pose(double angle_rad, const Eigen::Vector3d& translation_mm) {
  return Eigen::Translation3d(translation_mm) *
         Eigen::AngleAxisd(angle_rad, Eigen::Vector3d(1, 2, 3).normalized());
}

inline PreScanVolume volume_of(const ScanGeometry& geometry) {
  PreScanVolume volume;
  volume.geometry = geometry;
  const int count = geometry.samples() * geometry.lines() * geometry.frames();
  for (int i = 0; i < count; ++i) volume.voxels.push_back(static_cast<std::uint8_t>(7 * i));
  return volume;
}

inline PreScanVolume motorised() {
  return volume_of({{3, 3.0, 0.4},
                    CurvilinearArray{40.0, {-0.1, 0.1}},
                    MotorSweep{27.25, {0.2, 0.1, 0.0, -0.3}, -0.01}});
}

inline PreScanVolume tracked() {
  TrackedSweep sweep;
  for (int i = 0; i < 4; ++i) sweep.T_us_frame.push_back(pose(0.1 * i, {3.0 * i, 1.0, -2.0}));
  sweep.frame_times_s = {0.0, 0.5, 0.75, 1.5};
  return volume_of({{3, 3.0, 0.4}, LinearArray{{-1.0, 1.0}}, sweep});
}

inline BagOptions options_at(double start_s) {
  BagOptions options;
  options.start = ::ros::Time(start_s);
  options.frame_rate_hz = 4.0;
  return options;
}

}  // namespace usct::ros_interface
