#include "ros/ingest/image_poses.h"

#include <ros/init.h>

#include <chrono>
#include <exception>
#include <optional>
#include <thread>

#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"

namespace usct::ros_interface {

ImagePoses::ImagePoses(const ::ros::NodeHandle& node, const ImageStreamOptions& options)
    : us_frame_(options.sweep.us_frame_id),
      T_image_frame_(options.T_image_frame),
      // Beyond the sweep itself: the lag, the wait, and the time until the sweep is ended.
      buffer_(::ros::Duration(options.longest_sweep_s + options.tf_wait_s +
                              options.sweep.longest_pause_s + 10.0),
              options.max_tf_gap_s),
      input_(buffer_, node) {}

ArrayPoseThen ImagePoses::at(std::int64_t stamp_ns, const std::string& image_frame,
                             const ::ros::WallTime& deadline) const {
  // tf takes the time zero for the newest transform, which is not the pose of this image.
  if (stamp_ns <= 0) return {std::nullopt, "its time is before 1970"};
  while (true) {
    try {
      const geometry_msgs::TransformStamped found =
          buffer_.look_up(us_frame_, image_frame, time_from(stamp_ns));
      return {from_message_mm(found.transform, "tf") * T_image_frame_, {}};
    } catch (const std::exception& error) {  // from tf2, or for a time out of range
      if (::ros::WallTime::now() >= deadline || !::ros::ok()) return {std::nullopt, error.what()};
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

}  // namespace usct::ros_interface
