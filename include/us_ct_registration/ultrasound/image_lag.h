#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/ultrasound/tracked_images.h"

/// Images and poses of a tracked probe reach the computer by different ways, and images usually
/// arrive later. With an image lag L the image stamped t shows what the probe saw at t - L (L < 0:
/// poses arrive later). If the lag is not corrected, every frame is placed ahead of its true place
/// along the motion of the probe, and the registration is off by as much.
namespace usct {

/// The pose at a time, interpolated between the two poses around it: the translation linearly, the
/// rotation by slerp. Empty outside the recorded times. `sweep` must be valid and have times.
std::optional<Eigen::Isometry3d> pose_at(const TrackedSweep& sweep, double time_s);

/// A sweep after the correction of its lag.
struct LagCorrected {
  /// The frames that are left, each with the pose at its time minus the lag, and with that time.
  TrackedSweep sweep;
  /// The index of each of these frames in the sweep before. Frames at one end, whose time minus the
  /// lag is outside the recorded times, are left out.
  std::vector<int> frames;
};

/// Throws InputError, naming `source`, if the sweep is invalid or has no times, the lag is not
/// finite, or no frame is left.
LagCorrected correct_image_lag(const TrackedSweep& sweep, double lag_s, const std::string& source);

/// The lag as estimated from the images and poses of one sweep.
struct LagEstimate {
  /// Whether `lag_s` can be relied upon; otherwise `message` says why not.
  bool determined = false;
  std::string message;

  double lag_s = 0.0;
  /// Standard deviation of the lag, and its central 95 % interval, over resampled sweeps.
  double standard_error_s = 0.0;
  std::pair<double, double> interval_s{0.0, 0.0};
  /// The correlation of image change and probe speed, at the lag, and at the highest peak elsewhere
  /// (-1 if there is no other peak).
  double correlation = 0.0;
  double next_correlation = -1.0;
  /// The correlation in standard deviations of the correlation between unrelated signals of the
  /// same smoothness.
  double significance = 0.0;
  /// Standard deviation over mean of the probe's speed.
  double speed_variation = 0.0;
  /// The number of pairs of consecutive frames that were compared, and of images that equal the
  /// image before.
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

/// The same from B-mode images; pixels that show no ultrasound are ignored.
LagEstimate estimate_lag(const TrackedImages& images);

}  // namespace usct
