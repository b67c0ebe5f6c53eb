#include <boost/make_shared.hpp>

#include "finish.h"
#include "overlay_scene.h"
#include "ros/conversions/surface_markers.h"
#include "ros/overlay/overlay_painter.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {
namespace {

geometry_msgs::TransformStamped transform(const char* parent, const char* child) {
  geometry_msgs::TransformStamped message;
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform.rotation.w = 1.0;
  return message;
}

/// From an image message to the message with the overlay: tf look-up, copy, drawing, texts.
void image_to_overlay(benchmark::State& state) {
  ::ros::Time::init();
  OverlaySceneOptions options;
  options.styles["tumour"].has_band = true;
  OverlaySceneKeeper keeper(options);
  std::map<int, Surface> surfaces;
  for (const OverlayStructure& one : bench::kidney_scene())
    surfaces[static_cast<int>(surfaces.size()) + 1] = *one.surface;
  keeper.take_surface(to_markers(surfaces, {{2, {"tumour", {}}}}, "ct", 0));
  keeper.take_info({});
  us_ct_registration::Alignment alignment;
  alignment.state = us_ct_registration::Alignment::ACCEPTED;
  alignment.header.frame_id = "patient";
  alignment.ct_frame = "ct";
  alignment.transform.rotation.w = 1.0;
  alignment.expected_error = 0.001;
  keeper.take_alignment(alignment);
  TfBuffer tf;
  tf.set_transform(transform("patient", "ct"), "bench", true);
  tf.set_transform(transform("patient", "camera"), "bench", true);

  const CameraIntrinsics camera = bench::full_hd(true);
  auto info = boost::make_shared<sensor_msgs::CameraInfo>();
  info->header.stamp = ::ros::Time::now();
  info->header.frame_id = "camera";
  info->width = static_cast<std::uint32_t>(camera.width);
  info->height = static_cast<std::uint32_t>(camera.height);
  info->distortion_model = "plumb_bob";
  info->D.assign(camera.distortion.begin(), camera.distortion.begin() + 5);
  info->K = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  info->P = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header = info->header;
  image->width = info->width;
  image->height = info->height;
  image->encoding = "bgr8";
  image->step = 3 * image->width;
  image->data.assign(static_cast<std::size_t>(image->step) * image->height, 90);
  OverlayJob job;
  job.image = image;
  job.info = info;
  OverlayPainter painter({}, keeper, tf);
  for (auto _ : state) {
    const Overlay overlay = painter.paint(job);
    if (overlay.status.state == us_ct_registration::OverlayStatus::NOTHING)
      state.SkipWithError(overlay.status.message.c_str());
  }
  finish(state, 1);
}
BENCHMARK(image_to_overlay)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace usct::ros_interface
