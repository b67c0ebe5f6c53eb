#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"

/// The motion of the probe, recorded and true.
namespace usct::phantom {

enum class SweepKind { kMotorised, kTrackedCurvilinear, kTrackedLinear };

/// "motorised", "tracked-curvilinear", "tracked-linear". Throws InputError, naming `source`.
SweepKind parse_sweep(const std::string& text, const std::string& source);
std::string to_string(SweepKind kind);

struct SweepOptions {
  SweepKind kind = SweepKind::kMotorised;
  int samples = 154;
  int lines = 128;
  int frames = 81;
  /// Distance from the array's surface to the last sample, mm; (start_depth_mm, 300]. Unset: the
  /// depth that shows the scene's kidney.
  std::optional<double> depth_mm;
  double start_depth_mm = 0.0;
  /// Radius of the array's surface, mm. Unset: 40 motorised (4DC7-3/40), 60 tracked.
  std::optional<double> probe_radius_mm;
  double motor_radius_mm = 27.25;
  /// Angle between the outermost lines, degrees; [5, 120]. Unset: 0.010625 rad per line motorised,
  /// 60 tracked.
  std::optional<double> lateral_fov_deg;
  /// Width of a linear array, mm.
  double linear_width_mm = 50.0;
  /// Motor travel between the outermost frames, degrees; [2, 120]. Unset: 0.7317 per frame.
  std::optional<double> elevation_fov_deg;
  /// Motor travel within a frame, degrees (continuous sweep; negative in every other sweep).
  double frame_travel_deg = 0.0;
  /// Length of a tracked sweep, mm; [1, 300].
  double sweep_length_mm = 80.0;
  /// Frames per second of a tracked sweep.
  double frame_rate_hz = 20.0;

  /// The error of the recorded motor angles: 0 none, 1 as in thesis 3.1.6 (steps of 0.611 instead
  /// of 0.731 degrees on the negative side, 0.747 on the other), up to 2.
  double sweep_error = 0.0;
  /// Standard deviation of the recorded poses of tracked frames, per axis; mm and degrees.
  double pose_noise_mm = 0.0;
  double pose_noise_deg = 0.0;
  /// The image recorded with a pose at time t shows the scene at t - lag; [-2, 2] s.
  double lag_s = 0.0;
  /// Share of tracked frames whose image is that of the frame before; [0, 0.9].
  double duplicate_fraction = 0.0;

  /// Breathing during the sweep: the whole anatomy moves along the patient's superior axis, as a
  /// sine with this peak-to-peak amplitude, mm, and a phase by seed; [0, 30].
  double breathing_mm = 0.0;
  /// Duration of a breath, s; [1, 20].
  double breathing_period_s = 4.0;
  /// Time from the first to the last frame of a motorised sweep, s; [0.05, 60]. Unset: 1.5, the
  /// time that sound takes for 81 frames of 128 lines to a depth of 110 mm and back.
  std::optional<double> sweep_duration_s;

  void validate() const;
};

struct Acquisition {
  ScanGeometry recorded;
  ScanGeometry truth;
  /// For each frame, the index of the frame whose image it shows.
  std::vector<int> image_of_frame;
  /// For each frame, the displacement of the anatomy along the patient's superior axis when the
  /// image was taken, mm.
  std::vector<double> breathing_mm;
  /// Pose of the scene's probe frame (middle of the sweep) in the US frame.
  Eigen::Isometry3d T_us_probe = Eigen::Isometry3d::Identity();
};

/// A sweep with a depth of `depth_mm` over a surface that curves away from the middle of the sweep
/// with `surface_radius_mm` (tracked probes follow it).
Acquisition make_acquisition(const SweepOptions& options, double depth_mm, double surface_radius_mm,
                             std::uint64_t seed);

}  // namespace usct::phantom
