#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/ultrasound/tracked_images.h"

/// Temporal calibration of tracked ultrasound: images and poses of a tracked probe reach the
/// recorder by different ways, and images usually arrive later. With an image lag L, the image with
/// time stamp t shows what the probe saw at t - L (L < 0 if the poses arrive later). Without
/// correction every frame is placed at a later pose of the probe, and the registration has the same
/// error.
namespace usct {

/// The pose at a time, interpolated between the two poses around it: linearly for the translation,
/// by slerp for the rotation. Unset outside the recorded times. `sweep` must be valid and have
/// times.
std::optional<Eigen::Isometry3d> pose_at(const TrackedSweep& sweep, double time_s);

/// A sweep whose lag was corrected.
struct LagCorrected {
  /// For each frame, its time minus the lag and the pose at that time.
  TrackedSweep sweep;
  /// Indices of these frames in the original sweep. Frames at one end whose time minus the lag is
  /// outside the recorded times are dropped.
  std::vector<int> frames;
};

/// Corrects the lag of a sweep. Throws InputError, naming `source`, if the sweep is invalid or has
/// no times, the lag is not finite, or no frame is left.
LagCorrected correct_image_lag(const TrackedSweep& sweep, double lag_s, const std::string& source);

/// Estimate of the lag from the images and poses of one sweep.
struct LagEstimate {
  /// Whether the sweep determines `lag_s`; if not, `message` gives the reason.
  bool determined = false;
  std::string message;

  double lag_s = 0.0;
  /// Standard deviation and central 95 % interval of the lag over resampled sweeps.
  double standard_error_s = 0.0;
  std::pair<double, double> interval_s{0.0, 0.0};
  /// Correlation between image change and probe speed, at the lag and at the next highest peak (-1
  /// if there is no other peak).
  double correlation = 0.0;
  double next_correlation = -1.0;
  /// The correlation in standard deviations of the correlation of unrelated signals of the same
  /// smoothness.
  double significance = 0.0;
  /// Coefficient of variation of the probe's speed.
  double speed_variation = 0.0;
  /// Number of pairs of consecutive frames that were compared, and of images that equal the one
  /// before.
  int pairs = 0;
  int repeated_images = 0;
};

/// Estimates the lag. The speed of the probe is shifted by up to +-1.5 s (or half the sweep, if
/// that is less) against the mean absolute difference of consecutive images; the estimate is the
/// shift with the highest correlation. Both signals are clipped to their central 90 % and smoothed
/// by 0.1 s (or the frame interval, if that is more). Variation slower than 1 s is removed, since
/// anatomy that enters the image changes it as well. The uncertainty is that of 200 sweeps
/// resampled in blocks of 1 s. Pairs with a repeated image or a missing frame are left out.
///
/// The lag is not determined, and the message says why, if there are fewer than 20 pairs, the
/// images never change, the speed varies by less than 10 %, chance explains the correlation, the
/// peak lies at the end of the shifts, or the interval is wider than 0.5 s.
///
/// Deterministic. Throws InputError if the volume is invalid, motorised or without frame times.
LagEstimate estimate_lag(const PreScanVolume& volume);

/// Estimates the lag from B-mode images; pixels outside the ultrasound fan are ignored.
LagEstimate estimate_lag(const TrackedImages& images);

}  // namespace usct
