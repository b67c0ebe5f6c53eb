#pragma once

#include <tf2_msgs/TFMessage.h>
#include <us_ct_registration/PreScanVolume.h>

#include <string>

#include "ros/conversions/ultrasound.h"

namespace usct::ros_interface {

/// A small motorised sweep.
inline us_ct_registration::PreScanVolume sweep(const std::string& us_frame,
                                               const ::ros::Time& stamp) {
  PreScanVolume volume;
  MotorSweep motor{27.25, {}, 0.011};
  for (int i = 0; i < 12; ++i) motor.frame_angles_rad.push_back(0.0213 * i - 0.1);
  volume.geometry = {{20, 3.1, 0.37}, CurvilinearArray{40.3, {-0.1, 0.03, 0.1}}, motor};
  volume.voxels.resize(12 * 3 * 20);
  for (std::size_t i = 0; i < volume.voxels.size(); ++i)
    volume.voxels[i] = static_cast<std::uint8_t>(i % 251);
  std_msgs::Header header;
  header.frame_id = us_frame;
  header.stamp = stamp;
  return to_message(volume, header);
}

/// A frame in the frame `patient` at a stamp, to publish on tf.
inline tf2_msgs::TFMessage pose_of(const std::string& frame, const ::ros::Time& stamp,
                                   double x_m = 0.0) {
  tf2_msgs::TFMessage message;
  message.transforms.resize(1);
  message.transforms[0].header.frame_id = "patient";
  message.transforms[0].header.stamp = stamp;
  message.transforms[0].child_frame_id = frame;
  message.transforms[0].transform.translation.x = x_m;
  message.transforms[0].transform.rotation.w = 1.0;
  return message;
}

}  // namespace usct::ros_interface
