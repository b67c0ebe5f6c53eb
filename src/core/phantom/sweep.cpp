#include "us_ct_registration/phantom/sweep.h"

#include <cmath>

#include "phantom/check.h"
#include "random.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

// Data of the 4DC7-3/40 from public sources.
constexpr double kMotorisedRadiusMm = 40.0;
constexpr double kLinePitchRad = 0.010625;
constexpr double kFramePitchDeg = 0.7317;
// Thesis 3.1.6: specified and measured steps.
constexpr double kSpecifiedStepDeg = 0.731;
constexpr double kSlowStepDeg = 0.611;
constexpr double kFastStepDeg = 0.747;
constexpr double kTrackedRadiusMm = 60.0;
constexpr double kTrackedFovDeg = 60.0;
constexpr double kMotorisedDurationS = 1.5;

double radius_of(const SweepOptions& options) {
  if (options.kind == SweepKind::kTrackedLinear) return 0.0;
  return options.probe_radius_mm.value_or(options.kind == SweepKind::kMotorised ? kMotorisedRadiusMm
                                                                                : kTrackedRadiusMm);
}

Array array_of(const SweepOptions& options) {
  if (options.kind == SweepKind::kTrackedLinear)
    return LinearArray{centred_table(options.lines, options.linear_width_mm / (options.lines - 1))};
  double pitch = options.kind == SweepKind::kMotorised
                     ? kLinePitchRad
                     : kTrackedFovDeg * kDegree / (options.lines - 1);
  if (options.lateral_fov_deg) pitch = *options.lateral_fov_deg * kDegree / (options.lines - 1);
  return CurvilinearArray{radius_of(options), centred_table(options.lines, pitch)};
}

double true_motor_angle(double recorded, double error) {
  const double ratio = (recorded < 0.0 ? kSlowStepDeg : kFastStepDeg) / kSpecifiedStepDeg;
  return recorded * (1.0 + error * (ratio - 1.0));
}

/// Displacement by breathing at a time of the sweep.
double breathing_at(const SweepOptions& options, double time_s, std::uint64_t seed) {
  const double phase = 2.0 * kPi * uniform(hash(seed, 0xB4EA));
  const double turn = 2.0 * kPi * time_s / options.breathing_period_s;
  return 0.5 * options.breathing_mm * std::sin(turn + phase);
}

Acquisition motorised(const SweepOptions& options, const ScanGeometry& still, std::uint64_t seed) {
  double pitch_deg = kFramePitchDeg;
  if (options.elevation_fov_deg) pitch_deg = *options.elevation_fov_deg / (options.frames - 1);
  MotorSweep recorded;
  recorded.motor_radius_mm = options.motor_radius_mm;
  recorded.frame_angles_rad = centred_table(options.frames, pitch_deg * kDegree);
  recorded.frame_travel_rad = options.frame_travel_deg * kDegree;
  MotorSweep truth = recorded;
  for (double& angle : truth.frame_angles_rad) angle = true_motor_angle(angle, options.sweep_error);

  Acquisition acquisition{still, still, {}, {}, Isometry3d::Identity()};
  acquisition.recorded.motion = recorded;
  acquisition.truth.motion = truth;
  const double duration_s = options.sweep_duration_s.value_or(kMotorisedDurationS);
  for (int f = 0; f < options.frames; ++f) {
    acquisition.image_of_frame.push_back(f);
    acquisition.breathing_mm.push_back(
        breathing_at(options, duration_s * f / (options.frames - 1), seed));
  }
  acquisition.T_us_probe = Translation3d(0.0, radius_of(options), 0.0);
  return acquisition;
}

/// The path of a hand or robot that sweeps along the probe's elevation axis, in the probe frame.
class TrackedPath {
 public:
  TrackedPath(const SweepOptions& options, double surface_radius_mm, std::uint64_t seed)
      : length_mm_(options.sweep_length_mm),
        duration_s_(std::max(1, options.frames - 1) / options.frame_rate_hz),
        surface_radius_mm_(surface_radius_mm),
        array_radius_mm_(radius_of(options)) {
    Sequence random(seed, 0x9A77);
    for (double& phase : phases_) phase = random.between(0.0, 2.0 * kPi);
  }

  /// Pose of the frame coordinates in the probe frame at a time in seconds.
  Isometry3d T_probe_frame(double time_s) const {
    const double turn = 2.0 * kPi * time_s / duration_s_;
    // The speed varies by about +-45 %.
    const double along_mm =
        length_mm_ * (time_s / duration_s_ - 0.5 + 0.05 * std::sin(turn + phases_[0]) +
                      0.01 * std::sin(3.0 * turn + phases_[1]));
    const double sag_mm = 0.5 * along_mm * along_mm / surface_radius_mm_;
    const double lean_rad = 0.35 * along_mm / surface_radius_mm_;
    const Vector3d position(1.5 * std::sin(0.8 * turn + phases_[2]), sag_mm, along_mm);
    return Translation3d(position) * AngleAxisd(-lean_rad, Vector3d::UnitX()) *
           AngleAxisd(1.5 * kDegree * std::sin(turn + phases_[3]), Vector3d::UnitX()) *
           AngleAxisd(2.0 * kDegree * std::sin(0.6 * turn + phases_[4]), Vector3d::UnitY()) *
           AngleAxisd(1.0 * kDegree * std::sin(0.9 * turn + phases_[5]), Vector3d::UnitZ()) *
           Translation3d(0.0, -array_radius_mm_, 0.0);
  }

 private:
  double length_mm_;
  double duration_s_;
  double surface_radius_mm_;
  double array_radius_mm_;
  double phases_[6];
};

Isometry3d pose_noise(const SweepOptions& options, double radius_mm, Sequence& random) {
  const Vector3d turn(random.gaussian(0, 1), random.gaussian(0, 1), random.gaussian(0, 1));
  const Vector3d shift(random.gaussian(0, 1), random.gaussian(0, 1), random.gaussian(0, 1));
  const double angle = options.pose_noise_deg * kDegree * turn.norm();
  // The pivot is the middle of the array's surface, near which a sensor would be mounted.
  const Vector3d pivot(0.0, radius_mm, 0.0);
  return Translation3d(pivot + options.pose_noise_mm * shift) *
         AngleAxisd(angle, turn.normalized()) * Translation3d(-pivot);
}

Acquisition tracked(const SweepOptions& options, const ScanGeometry& still,
                    double surface_radius_mm, std::uint64_t seed) {
  Acquisition acquisition{still, still, {}, {}, Isometry3d::Identity()};
  Sequence random(seed, 0x74AC);
  // The base of the tracker or robot may be anywhere.
  acquisition.T_us_probe =
      Translation3d(random.between(-300.0, 300.0), random.between(-300.0, 300.0),
                    random.between(200.0, 600.0)) *
      AngleAxisd(random.between(0.0, kPi), random.direction());
  const TrackedPath path(options, surface_radius_mm, seed);
  TrackedSweep recorded;
  TrackedSweep truth;
  for (int f = 0; f < options.frames; ++f) {
    const double time_s = f / options.frame_rate_hz;
    const bool duplicate = f > 0 && uniform(random.next()) < options.duplicate_fraction;
    const int image = duplicate ? acquisition.image_of_frame.back() : f;
    acquisition.image_of_frame.push_back(image);
    const double image_time_s = image / options.frame_rate_hz - options.lag_s;
    acquisition.breathing_mm.push_back(breathing_at(options, image_time_s, seed));
    truth.T_us_frame.push_back(acquisition.T_us_probe * path.T_probe_frame(image_time_s));
    recorded.T_us_frame.push_back(acquisition.T_us_probe * path.T_probe_frame(time_s) *
                                  pose_noise(options, radius_of(options), random));
    recorded.frame_times_s.push_back(time_s);
    truth.frame_times_s.push_back(std::max(
        image_time_s, truth.frame_times_s.empty() ? image_time_s : truth.frame_times_s.back()));
  }
  acquisition.recorded.motion = recorded;
  acquisition.truth.motion = truth;
  return acquisition;
}

}  // namespace

SweepKind parse_sweep(const std::string& text, const std::string& source) {
  for (const SweepKind kind :
       {SweepKind::kMotorised, SweepKind::kTrackedCurvilinear, SweepKind::kTrackedLinear})
    if (text == to_string(kind)) return kind;
  throw InputError(
      source, "sweep is '" + text + "', must be motorised, tracked-curvilinear or tracked-linear");
}

std::string to_string(SweepKind kind) {
  switch (kind) {
    case SweepKind::kMotorised:
      return "motorised";
    case SweepKind::kTrackedCurvilinear:
      return "tracked-curvilinear";
    case SweepKind::kTrackedLinear:
      return "tracked-linear";
  }
  return {};
}

void SweepOptions::validate() const {
  require_range("samples", samples, 16, 8192);
  require_range("lines", lines, 8, 1024);
  require_range("frames", frames, 2, 2000);
  require_range("start_depth_mm", start_depth_mm, 0.0, 100.0);
  if (depth_mm) require_range("depth_mm", *depth_mm, start_depth_mm + 5.0, 300.0);
  if (probe_radius_mm) require_range("probe_radius_mm", *probe_radius_mm, 5.0, 200.0);
  require_range("motor_radius_mm", motor_radius_mm, 1.0, 200.0);
  if (lateral_fov_deg) require_range("lateral_fov_deg", *lateral_fov_deg, 5.0, 120.0);
  require_range("linear_width_mm", linear_width_mm, 5.0, 200.0);
  if (elevation_fov_deg) require_range("elevation_fov_deg", *elevation_fov_deg, 2.0, 120.0);
  require_range("frame_travel_deg", frame_travel_deg, -5.0, 5.0);
  require_range("sweep_length_mm", sweep_length_mm, 1.0, 300.0);
  require_range("frame_rate_hz", frame_rate_hz, 0.1, 1000.0);
  require_range("sweep_error", sweep_error, 0.0, 2.0);
  require_range("pose_noise_mm", pose_noise_mm, 0.0, 20.0);
  require_range("pose_noise_deg", pose_noise_deg, 0.0, 20.0);
  require_range("lag_s", lag_s, -2.0, 2.0);
  require_range("duplicate_fraction", duplicate_fraction, 0.0, 0.9);
  require_range("breathing_mm", breathing_mm, 0.0, 30.0);
  require_range("breathing_period_s", breathing_period_s, 1.0, 20.0);
  if (sweep_duration_s) require_range("sweep_duration_s", *sweep_duration_s, 0.05, 60.0);
  const bool is_motorised = kind == SweepKind::kMotorised;
  const auto only_for = [](const std::string& option, bool set, const std::string& sweep) {
    if (set)
      throw InputError("phantom options",
                       "'" + option + "' is set, must be left out unless the sweep is " + sweep);
  };
  only_for("sweep_error", !is_motorised && sweep_error != 0.0, "motorised");
  only_for("frame_travel_deg", !is_motorised && frame_travel_deg != 0.0, "motorised");
  only_for("sweep_duration_s", !is_motorised && sweep_duration_s, "motorised");
  only_for("elevation_fov_deg", !is_motorised && elevation_fov_deg, "motorised");
  only_for("pose_noise_mm", is_motorised && pose_noise_mm != 0.0, "tracked");
  only_for("pose_noise_deg", is_motorised && pose_noise_deg != 0.0, "tracked");
  only_for("lag_s", is_motorised && lag_s != 0.0, "tracked");
  only_for("duplicate_fraction", is_motorised && duplicate_fraction != 0.0, "tracked");
}

Acquisition make_acquisition(const SweepOptions& options, double depth_mm, double surface_radius_mm,
                             std::uint64_t seed) {
  ScanGeometry still;
  still.axial = {options.samples, options.start_depth_mm,
                 (depth_mm - options.start_depth_mm) / (options.samples - 1)};
  still.array = array_of(options);
  Acquisition acquisition = options.kind == SweepKind::kMotorised
                                ? motorised(options, still, seed)
                                : tracked(options, still, surface_radius_mm, seed);
  acquisition.recorded.validate("phantom options");
  acquisition.truth.validate("phantom options");
  return acquisition;
}

}  // namespace usct::phantom
