#pragma once

#include <memory>
#include <optional>

#include "ros/fusion/fusion_scene.h"

namespace usct::ros_interface {

/// Draws scenes, and keeps the ultrasound as it is drawn from one to the next. One object per
/// thread.
class FusionPainter {
 public:
  explicit FusionPainter(double pixel_mm) : pixel_mm_(pixel_mm) {}

  /// `scene.us` must not be null. Where nothing can be simulated, contours are drawn instead, and
  /// the sheet says why. Throws InputError if the ultrasound is invalid.
  FusionView paint(const FusionScene& scene);

 private:
  const ScanConverted& in_space(const std::shared_ptr<const FusionUltrasound>& us);
  /// Throws InputError that says why nothing could be simulated.
  const ScanConverted& simulated(const FusionScene& scene);

  const double pixel_mm_;
  std::shared_ptr<const FusionUltrasound> us_;
  ScanConverted in_space_;
  /// The scene for which the ultrasound below was simulated.
  std::optional<FusionScene> simulated_scene_;
  ScanConverted simulated_;
};

}  // namespace usct::ros_interface
