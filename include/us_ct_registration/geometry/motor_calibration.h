#pragma once

#include <limits>
#include <string>
#include <vector>

/// Calibration of a motorised probe's sweep with an N-wire phantom (thesis 3.1.6).
///
/// Two wires run parallel to the elevation axis, a distance d apart in depth. A frame at the motor
/// angle phi cuts them obliquely and shows them h = d / cos(phi) apart (eq 3.1, where the angle is
/// called theta). h does not tell the sign: it is smallest where the frame is perpendicular to the
/// wires, and the angle changes its sign there.
namespace usct {

/// Distances of the wires in the frames of several sweeps over the same phantom.
struct WireDistances {
  /// d, from a CT or a drawing of the phantom.
  double true_distance_mm = 0.0;
  /// h in mm, `volumes[volume][frame]`; NaN where the wires were not found.
  std::vector<std::vector<double>> volumes;

  /// Throws InputError, naming `source`, unless: the true distance is finite and > 0; there is at
  /// least one volume, with 8 frames or more and all with the same number; each distance is NaN or
  /// finite and > 0.
  void validate(const std::string& source) const;
};

struct MotorCalibrationOptions {
  /// Frame angles rise with the frame number; false for a sweep recorded the other way round.
  bool rising = true;
  /// Estimates the distance of the wires together with the angles instead of trusting it. The
  /// ratio of the two is then a sound speed error: 1 % of it moves angles near zero by 8 degrees.
  bool fit_distance = false;
  /// How far the averaged distance of a frame may fall below the true one, as a fraction of it,
  /// before it counts as a contradiction and not as noise.
  double shortfall_tolerance = 0.02;
  /// Averaged distances may scatter about the fit by this, RMS and as a fraction of the true
  /// distance, before the sweep counts as not piecewise even.
  double residual_tolerance = 0.02;

  /// Throws InputError unless both tolerances are finite and > 0.
  void validate(const std::string& source) const;
};

/// The angle of one frame as measured by the wires.
struct SliceAngle {
  enum class Status {
    kMeasured,   // h > d: angle by eq 3.1
    kAtMinimum,  // h <= d within the tolerance: noise, the frame is close to zero angle
    kMissing,    // no volume shows the wires
  };
  Status status = Status::kMissing;
  int volumes = 0;           // in which the wires were found
  double distance_mm = 0.0;  // mean of h over them
  double angle_rad = 0.0;    // eq 3.1 with the sign of its side; 0 at the minimum
  double residual_mm = 0.0;  // mean of h minus the fit
};

/// One half of a sweep, on one side of zero angle.
struct SweepHalf {
  double step_rad = 0.0;            // per frame
  double standard_error_rad = 0.0;  // of the step
  int frames = 0;                   // used in the fit
};

struct MotorCalibration {
  /// One per frame, of the fitted sweep: what a probe YAML takes as `frame_angles_deg`.
  std::vector<double> frame_angles_rad;
  /// The frame, between two of them as a rule, that is perpendicular to the wires: zero angle. If
  /// the wires were not exactly along the elevation axis, the US frame is turned about the motor
  /// axis by as much, which a rigid registration absorbs.
  double zero_frame = 0.0;
  double zero_frame_standard_error = 0.0;
  SweepHalf before;  // frames up to zero_frame
  SweepHalf after;
  /// The true distance, or the fitted one with `fit_distance`.
  double distance_mm = 0.0;
  double distance_standard_error_mm = 0.0;
  double rms_residual_mm = 0.0;    // of averaged distances about the fit
  std::vector<SliceAngle> slices;  // one per frame
};

/// Fits two half sweeps with even steps each, which meet at zero angle, to the averaged distances.
///
/// The fit is least squares in h, where the noise is, not in the angle: near zero, where h hardly
/// depends on the angle and eq 3.1 may have no solution, frames weigh as little as they know, and
/// no sign has to be chosen. Standard errors are from the scatter about the fit.
///
/// Throws InputError, naming `source`, if the input is invalid; if h has no minimum within the
/// sweep with at least 3 frames on either side of it; or if a tolerance is exceeded, with the
/// numbers and what to look at.
MotorCalibration calibrate_motor(const WireDistances& distances,
                                 const MotorCalibrationOptions& options, const std::string& source);

}  // namespace usct
