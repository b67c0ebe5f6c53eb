#pragma once

#include <ros/node_handle.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <string>

#include "ros/ingest/ingest_parameters.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"
#include "us_ct_registration/ultrasound/image_sweep.h"

namespace usct::ros_interface {

/// Poses of the array whose images are recorded, from tf, over the time of the longest sweep.
class ImagePoses {
 public:
  ImagePoses(const ::ros::NodeHandle& node, const ImageStreamOptions& options);

  /// The pose of the array that moves with the tf frame `image_frame`. Waits for tf until
  /// `deadline`, of the wall clock: simulated time may stand still.
  ArrayPoseThen at(std::int64_t stamp_ns, const std::string& image_frame,
                   const ::ros::WallTime& deadline) const;

 private:
  const std::string us_frame_;
  const Eigen::Isometry3d T_image_frame_;
  TfBuffer buffer_;
  TfInput input_;
};

}  // namespace usct::ros_interface
