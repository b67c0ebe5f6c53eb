#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/ultrasound/compounding.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

/// Time before space: images and poses of a tracked probe come by different ways, and images come
/// later. With an image lag L the image stamped t shows what the probe saw at t - L (L < 0: poses
/// come later). Uncorrected, every frame lies where the probe was going, and a registration
/// follows.
namespace usct {

/// The pose at a time, from the two around it: translation linear, rotation by slerp. Empty outside
/// the recorded times. `sweep` must be valid and have times.
std::optional<Eigen::Isometry3d> pose_at(const TrackedSweep& sweep, double time_s);

/// A sweep after the correction of its lag.
struct LagCorrected {
  /// Each frame's pose at its time minus the lag, and those times.
  TrackedSweep sweep;
  /// Which frames these are: those at one end, whose time minus the lag is outside the recorded
  /// times, are left out.
  std::vector<int> frames;
};

/// Throws InputError, naming `source`, if the sweep is invalid or has no times, the lag is not
/// finite, or no frame is left.
LagCorrected correct_image_lag(const TrackedSweep& sweep, double lag_s, const std::string& source);

/// What images and poses of one sweep say of the lag.
struct LagEstimate {
  /// Whether `lag_s` can be relied upon; otherwise `message` says why not.
  bool determined = false;
  std::string message;

  double lag_s = 0.0;
  /// Standard deviation and central 95 % over resampled sweeps.
  double standard_error_s = 0.0;
  std::pair<double, double> interval_s{0.0, 0.0};
  /// Between image change and probe speed: at the lag, and at the next best shift beside that peak
  /// (-1 if there is no other peak).
  double correlation = 0.0;
  double next_correlation = -1.0;
  /// Height of the correlation in standard deviations of what unrelated signals of the same
  /// smoothness would show.
  double significance = 0.0;
  /// Standard deviation over mean of the probe's speed.
  double speed_variation = 0.0;
  /// Pairs of consecutive frames that were compared, and images that equal the one before.
  int pairs = 0;
  int repeated_images = 0;
};

/// Shifts the probe's speed by up to +-1.5 s (or half the sweep, if that is less) against the mean
/// absolute difference of consecutive images and looks for the highest correlation. Both are
/// clipped to their central 90 % and smoothed by 0.1 s (or the frame interval, if that is more);
/// what varies more slowly than 1 s is taken out, since anatomy that enters the image changes it as
/// well.
/// The uncertainty is that of 200 sweeps resampled in blocks of 1 s. Pairs with a repeated image or
/// a missing frame are left out.
///
/// Not determined, with the reason: fewer than 20 pairs, images that never change, a speed that
/// varies by less than 10 %, a correlation that chance explains, a peak at the end of the shifts,
/// or an interval wider than 0.5 s.
///
/// Deterministic. Throws InputError if the volume is invalid, motorised or without frame times.
LagEstimate estimate_lag(const PreScanVolume& volume);

/// The same from B-mode images; where they show no ultrasound does not count.
LagEstimate estimate_lag(const TrackedImages& images);

}  // namespace usct
