#include "ros/fusion/fusion_painter.h"

#include <algorithm>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {

const ScanConverted& FusionPainter::in_space(const std::shared_ptr<const FusionUltrasound>& us) {
  if (us != us_) {
    us_ = nullptr;
    in_space_ = in_fusion_space(us->volume);
    us_ = us;
  }
  return in_space_;
}

const ScanConverted& FusionPainter::simulated(const FusionScene& scene) {
  const bool is_known = simulated_scene_ && simulated_scene_->us == scene.us &&
                        simulated_scene_->ct == scene.ct &&
                        simulated_scene_->pose.T_us_ct->matrix() == scene.pose.T_us_ct->matrix();
  if (!is_known) {
    simulated_scene_.reset();
    simulated_ =
        in_fusion_space(simulate_like(scene.us->volume, scene.ct->volume, *scene.pose.T_us_ct));
    simulated_scene_ = scene;
  }
  return simulated_;
}

FusionView FusionPainter::paint(const FusionScene& scene) {
  const ScanConverted& us = in_space(scene.us);
  FusionPose pose = scene.pose;
  FusionViewOptions options;
  options.mode = scene.mode;
  options.pictures.pixel_mm = pixel_mm_;
  options.pictures.axes_us = picture_axes(scene.us->volume);
  const auto within = std::find_if(
      scene.centres_us_mm.begin(), scene.centres_us_mm.end(), [&](const Eigen::Vector3d& p) {
        return contains_index(us.volume.grid, us.volume.grid.index_from_physical(p));
      });
  if (within != scene.centres_us_mm.end()) options.pictures.centre_us_mm = *within;
  const ScanConverted* simulation = nullptr;
  if (pose.T_us_ct && scene.mode == FusionMode::kSimulated) try {
      simulation = &simulated(scene);
    } catch (const InputError& error) {
      options.mode = FusionMode::kContours;
      pose.evidence = std::string("NOT SIMULATED: ") + error.what() + "\n" + pose.evidence;
    }
  return draw_fusion_view(us, scene.ct ? &scene.ct->volume : nullptr, simulation, pose, options);
}

}  // namespace usct::ros_interface
