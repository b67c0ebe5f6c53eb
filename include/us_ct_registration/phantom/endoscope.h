#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "us_ct_registration/geometry/camera.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom {

/// A stereo endoscope that looks at the exposed kidney of a phantom. Lengths in mm, times in s.
struct EndoscopeOptions {
  /// Size of the images, pixels; [64, 4096].
  int width = 960;
  int height = 540;
  /// Horizontal field of view without distortion; [20, 100].
  double field_of_view_deg = 56.0;
  /// k1, k2, p1, p2, k3 of the model plumb_bob.
  std::array<double, 5> distortion{-0.26, 0.10, 0.0008, -0.0006, -0.012};
  /// Distance of the right camera from the left one, along its x axis; [0, 20].
  double baseline_mm = 4.4;
  int frames = 40;  // [1, 10000]
  double rate_hz = 10.0;
  /// The camera moves sideways by this much in either direction; [0, 30].
  double camera_motion_mm = 4.0;
  /// Peak-to-peak motion of the anatomy along the patient's superior axis; [0, 30].
  double breathing_mm = 0.0;
  double breathing_period_s = 4.0;  // [1, 20]
  /// Instruments that hide a part of the view; [0, 2].
  int instruments = 2;
  /// Standard deviation of the noise, grey levels; [0, 50].
  double noise = 2.0;

  /// Throws InputError naming the option, its value and its range.
  void validate() const;
};

enum class Eye { kLeft, kRight };

struct EndoscopeImage {
  int width = 0;
  int height = 0;
  /// Red, green, blue; rows from the top.
  std::vector<std::uint8_t> rgb;
  /// The truth: 255 where the line of sight of the pixel's centre meets the tumour, whether or not
  /// something lies before it.
  std::vector<std::uint8_t> tumour;
  /// 255 where an instrument is seen.
  std::vector<std::uint8_t> instrument;
};

/// Renders the video of a laparoscope: the kidney with its tumour, freed from the fat in front of
/// it, in a bed of fat, lit from the camera.
///
/// Each pixel is a ray that is followed to the surface of the anatomy, the same anatomy that CT and
/// ultrasound are formed from. Rays come from an inversion of the lens model of its own, so that
/// images and masks share no code with the projection that they serve to judge.
class Endoscope {
 public:
  /// Throws InputError if an option is invalid or if the anatomy of `phantom` has no tumour; its
  /// scene must be `patient`.
  Endoscope(const PhantomOptions& phantom, const EndoscopeOptions& options);
  ~Endoscope();
  Endoscope(Endoscope&&) noexcept;

  const EndoscopeOptions& options() const { return options_; }
  /// The same for both cameras; their axes are parallel.
  const CameraIntrinsics& intrinsics() const { return intrinsics_; }
  /// The mean position of the tumour's tissue in the CT.
  const Eigen::Vector3d& tumour_centre_ct_mm() const { return tumour_centre_ct_mm_; }

  double time_s(int frame) const { return frame / options_.rate_hz; }
  /// By which breathing has moved the anatomy from its position in the CT and the ultrasound, in CT
  /// coordinates.
  Eigen::Vector3d shift_ct_mm(int frame) const;
  /// Pose of the optical frame (z forward, x right, y down) in the coordinates of the CT, which do
  /// not move with breathing: a point `p_ct` of the anatomy is seen at
  /// `T_ct_camera(eye, frame).inverse() * (p_ct + shift_ct_mm(frame))`.
  Eigen::Isometry3d T_ct_camera(Eye eye, int frame) const;

  /// The same bits with any number of threads. Throws InputError if there is no such frame.
  EndoscopeImage image(Eye eye, int frame) const;

 private:
  struct Field;

  EndoscopeOptions options_;
  std::uint64_t seed_;
  CameraIntrinsics intrinsics_;
  std::unique_ptr<const Field> field_;
  Eigen::Vector3d tumour_centre_ct_mm_;
  /// The middle of what the camera looks at, and the pose of the left camera in the middle of its
  /// motion.
  Eigen::Vector3d aim_ct_mm_;
  Eigen::Isometry3d T_ct_rest_ = Eigen::Isometry3d::Identity();
};

}  // namespace usct::phantom
