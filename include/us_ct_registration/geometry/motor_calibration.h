#pragma once

#include <limits>
#include <string>
#include <vector>

/// Calibration of a motorised probe's sweep with an N-wire phantom (thesis 3.1.6).
///
/// Two wires run parallel to the elevation axis, a distance d apart in depth. A frame at the motor
/// angle phi cuts them obliquely and shows them h = d / cos(phi) apart (eq 3.1, where the angle is
/// called theta). The sign of the angle does not follow from h: h is smallest where the frame is
/// perpendicular to the wires, and the angle changes its sign there.
namespace usct {

/// Distances of the wires in the frames of several sweeps over the same phantom.
struct WireDistances {
  /// The true distance d of the wires, from a CT or a drawing of the phantom.
  double true_distance_mm = 0.0;
  /// The measured distances h in mm, `volumes[volume][frame]`; NaN where the wires were not found.
  std::vector<std::vector<double>> volumes;

  /// Throws InputError, naming `source`, unless all of this holds: the true distance is finite and
  /// > 0; there is at least one volume; every volume has the same number of frames, 8 or more; each
  /// distance is NaN or finite and > 0.
  void validate(const std::string& source) const;
};

struct MotorCalibrationOptions {
  /// Whether frame angles rise with the frame number; false for a sweep recorded in the other
  /// direction.
  bool rising = true;
  /// Whether the distance of the wires is estimated together with the angles instead of taken as
  /// known. The ratio of the estimate to the known distance is then the error of the speed of
  /// sound: an error of 1 % moves angles near zero by 8 degrees.
  bool fit_distance = false;
  /// Tolerance, as a fraction of the true distance: an averaged distance below the true one by no
  /// more than this is taken for noise, by more for a contradiction.
  double shortfall_tolerance = 0.02;
  /// Tolerance, RMS and as a fraction of the true distance, of the scatter of averaged distances
  /// about the fit. A sweep that scatters more is not piecewise even, and is refused.
  double residual_tolerance = 0.02;

  /// Throws InputError unless both tolerances are finite and > 0.
  void validate(const std::string& source) const;
};

/// Result for one frame.
struct SliceAngle {
  enum class Status {
    kMeasured,   // h > d: angle by eq 3.1
    kAtMinimum,  // h <= d within the tolerance: noise, the frame is close to zero angle
    kMissing,    // no volume shows the wires
  };
  Status status = Status::kMissing;
  int volumes = 0;           // number of volumes that show the wires in this frame
  double distance_mm = 0.0;  // mean of h over these volumes
  double angle_rad = 0.0;    // by eq 3.1, negative before zero_frame if rising; 0 for kAtMinimum
  double residual_mm = 0.0;  // mean of h minus the fit
};

/// One half of a sweep, on one side of zero angle.
struct SweepHalf {
  double step_rad = 0.0;            // motor angle from one frame to the next
  double standard_error_rad = 0.0;  // of step_rad
  int frames = 0;                   // number of frames that the fit used
};

struct MotorCalibration {
  /// Fitted motor angles, one per frame, which a probe YAML takes as `frame_angles_deg`.
  std::vector<double> frame_angles_rad;
  /// Continuous frame index, between two frames as a rule, at which the frame is perpendicular to
  /// the wires and the motor angle is zero. If the wires were not exactly along the elevation axis,
  /// the US frame is turned about the motor axis by the same angle, which a rigid registration
  /// absorbs.
  double zero_frame = 0.0;
  double zero_frame_standard_error = 0.0;
  SweepHalf before;  // the frames up to zero_frame
  SweepHalf after;
  /// The true distance, or the fitted one with `fit_distance`.
  double distance_mm = 0.0;
  double distance_standard_error_mm = 0.0;
  double rms_residual_mm = 0.0;    // of the averaged distances about the fit
  std::vector<SliceAngle> slices;  // one per frame
};

/// Fits two half sweeps with even steps each, which meet at zero angle, to the averaged distances.
///
/// The fit minimises squared residuals of h, the measured quantity, not of the angle. Near zero
/// angle h hardly depends on the angle and eq 3.1 may have no solution; there a frame has little
/// influence on the fit, and no sign has to be chosen. Standard errors come from the scatter about
/// the fit.
///
/// Throws InputError, naming `source`, if the input is invalid; if h has no minimum within the
/// sweep with at least 3 frames on either side of it; or if a tolerance is exceeded. The message
/// gives the numbers and says what to check.
MotorCalibration calibrate_motor(const WireDistances& distances,
                                 const MotorCalibrationOptions& options, const std::string& source);

}  // namespace usct
