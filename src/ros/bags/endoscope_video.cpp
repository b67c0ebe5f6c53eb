#include "ros/bags/endoscope_video.h"

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/distortion_models.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>

#include "ros/conversions/poses.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/rendering/picture.h"

namespace usct::ros_interface {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

/// The place of the robot, and that of the cameras on the tip of its endoscope, which looks 30
/// degrees down. The values are of no importance, but none is the identity.
const Isometry3d kTFixedBase =
    Translation3d(-350.0, 620.0, -180.0) * AngleAxisd(-1.1, Vector3d::UnitZ());
const Isometry3d kTTipLeft = Translation3d(-2.2, 1.5, 6.0) * AngleAxisd(0.5236, Vector3d::UnitX()) *
                             AngleAxisd(0.02, Vector3d::UnitZ());

Isometry3d T_left_right(const EndoscopeVideo& video) {
  return Isometry3d(Translation3d(video.baseline_mm, 0.0, 0.0));
}

sensor_msgs::CameraInfo camera_info(const EndoscopeVideo& video, const std_msgs::Header& header,
                                    double baseline_mm) {
  const CameraIntrinsics& camera = video.camera;
  sensor_msgs::CameraInfo info;
  info.header = header;
  info.width = static_cast<std::uint32_t>(camera.width);
  info.height = static_cast<std::uint32_t>(camera.height);
  info.distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  info.D.assign(camera.distortion.begin(), camera.distortion.begin() + 5);
  info.K = {camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0};
  info.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  info.P = {camera.fx, 0.0,       camera.cx, -camera.fx * baseline_mm / kMmPerM,
            0.0,       camera.fy, camera.cy, 0.0,
            0.0,       0.0,       1.0,       0.0};
  return info;
}

/// A picture as an image with the first `channels` of red, green, blue.
sensor_msgs::Image read_image(const EndoscopeVideo& video, const std::string& name,
                              const std_msgs::Header& header, unsigned channels) {
  const std::filesystem::path path = video.folder / name;
  const Picture picture = read_png(path);
  if (picture.width != video.camera.width || picture.height != video.camera.height)
    throw InputError(path.string(),
                     formatted("is %d x %d pixels, must be %d x %d as the camera's", picture.width,
                               picture.height, video.camera.width, video.camera.height));
  sensor_msgs::Image image;
  image.header = header;
  image.width = static_cast<std::uint32_t>(picture.width);
  image.height = static_cast<std::uint32_t>(picture.height);
  image.encoding =
      channels == 3 ? sensor_msgs::image_encodings::RGB8 : sensor_msgs::image_encodings::MONO8;
  image.step = channels * image.width;
  image.data.reserve(std::size_t{image.step} * image.height);
  for (std::size_t i = 0; i < picture.pixels.size(); i += 3)
    image.data.insert(image.data.end(), &picture.pixels[i], &picture.pixels[i] + channels);
  return image;
}

}  // namespace

std::vector<geometry_msgs::TransformStamped> endoscope_calibration(const EndoscopeVideo& video,
                                                                   const std::string& fixed_frame,
                                                                   const EndoscopeFrames& frames,
                                                                   const ::ros::Time& stamp) {
  return {stamped_transform(stamp, kTFixedBase, fixed_frame, frames.base),
          stamped_transform(stamp, kTTipLeft, frames.tip, frames.left),
          stamped_transform(stamp, T_left_right(video), frames.left, frames.right)};
}

void record_endoscope(const EndoscopeVideo& video, const Isometry3d& T_fixed_ct,
                      const EndoscopeFrames& frames, const ::ros::Time& first,
                      Recording& recording) {
  for (std::size_t i = 0; i < video.frames.size(); ++i) {
    const auto& [time_s, T_ct_left] = video.frames[i];
    const ::ros::Time stamp = first + ::ros::Duration(time_s);
    const Isometry3d T_base_tip =
        kTFixedBase.inverse() * T_fixed_ct * T_ct_left * kTTipLeft.inverse();
    tf2_msgs::TFMessage tf;
    tf.transforms = {stamped_transform(stamp, T_base_tip, frames.base, frames.tip)};
    recording.add("/tf", stamp, tf);
    for (const bool right : {false, true}) {
      const std::string side = right ? "right" : "left";
      std_msgs::Header header;
      header.stamp = stamp;
      header.frame_id = right ? frames.right : frames.left;
      const auto name = [&](const char* kind) { return side + formatted("%s_%04zu.png", kind, i); };
      recording.add("/endoscope/" + side + "/camera_info", stamp,
                    camera_info(video, header, right ? video.baseline_mm : 0.0));
      recording.add("/endoscope/" + side + "/image_raw", stamp,
                    read_image(video, name(""), header, 3));
      recording.add("/truth/endoscope/" + side + "/tumour", stamp,
                    read_image(video, name("_tumour"), header, 1));
    }
  }
}

}  // namespace usct::ros_interface
