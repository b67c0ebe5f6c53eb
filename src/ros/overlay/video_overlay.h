#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <us_ct_registration/OverlayStatus.h>

#include <memory>
#include <string>
#include <vector>

#include "ros/node/parameters.h"
#include "ros/overlay/overlay_camera.h"
#include "ros/overlay/overlay_scene.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"

namespace usct::ros_interface {

/// Draws the structures of the CT into the images of an endoscope, mono or stereo: wires topics and
/// parameters to OverlaySceneKeeper and one OverlayCamera per image topic.
/// docs/nodes/video_overlay.md.
class VideoOverlay {
 public:
  VideoOverlay(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);
  ~VideoOverlay();

 private:
  enum Eye { kLeft = 0, kRight = 1 };

  void read_parameters(Parameters& parameters);
  void add_camera(const std::string& side, const OverlayPainterOptions& painting);
  /// Says how the images of a camera are projected, and whether a stereo pair is out of step.
  void complete(std::size_t eye, OverlayJob& job) const;
  std::string out_of_step(std::size_t eye) const;
  void diagnose(std::size_t eye, diagnostic_updater::DiagnosticStatusWrapper& diagnosis);

  ::ros::NodeHandle node_;
  bool is_stereo_ = false;
  bool is_rectified_ = false;
  bool has_own_frame_ = false;
  double max_stereo_skew_s_ = 0.0;
  std::string transport_;
  std::string plugin_namespace_;
  OverlaySceneOptions scene_options_;
  OverlayPainterOptions painting_;
  double max_tf_gap_s_ = 0.0;
  std::unique_ptr<TfBuffer> tf_;
  std::unique_ptr<OverlaySceneKeeper> keeper_;
  std::unique_ptr<TfInput> tf_input_;
  std::vector<::ros::Subscriber> subscribers_;
  ::ros::Publisher status_publisher_;
  std::vector<std::string> sides_;
  std::vector<std::unique_ptr<OverlayCamera>> cameras_;
  diagnostic_updater::Updater diagnostics_;
  ::ros::WallTimer diagnostics_timer_;
};

}  // namespace usct::ros_interface
