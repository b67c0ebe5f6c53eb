#include "us_ct_registration/ultrasound/image_lag.h"

#include <algorithm>
#include <cmath>

#include "us_ct_registration/error.h"

namespace usct {

std::optional<Eigen::Isometry3d> pose_at(const TrackedSweep& sweep, double time_s) {
  const std::vector<double>& times = sweep.frame_times_s;
  if (!(time_s >= times.front() && time_s <= times.back())) return std::nullopt;
  const auto above = std::lower_bound(times.begin(), times.end(), time_s);
  const auto i = static_cast<std::size_t>(above - times.begin());
  if (*above == time_s) return sweep.T_us_frame[i];
  const Eigen::Isometry3d& before = sweep.T_us_frame[i - 1];
  const Eigen::Isometry3d& after = sweep.T_us_frame[i];
  const double share = (time_s - times[i - 1]) / (times[i] - times[i - 1]);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(before.linear())
                   .slerp(share, Eigen::Quaterniond(after.linear()))
                   .toRotationMatrix();
  T.translation() = (1.0 - share) * before.translation() + share * after.translation();
  return T;
}

LagCorrected correct_image_lag(const TrackedSweep& sweep, double lag_s, const std::string& source) {
  if (sweep.frame_times_s.empty() || sweep.frame_times_s.size() != sweep.T_us_frame.size())
    throw InputError(source, "has no time for each frame: a lag cannot be corrected");
  if (!std::isfinite(lag_s)) throw InputError(source, "the image lag is not finite");
  LagCorrected corrected;
  for (std::size_t i = 0; i < sweep.frame_times_s.size(); ++i) {
    const double time_s = sweep.frame_times_s[i] - lag_s;
    const std::optional<Eigen::Isometry3d> T = pose_at(sweep, time_s);
    if (!T) continue;
    corrected.frames.push_back(static_cast<int>(i));
    corrected.sweep.T_us_frame.push_back(*T);
    corrected.sweep.frame_times_s.push_back(time_s);
  }
  if (corrected.frames.empty())
    throw InputError(
        source, "the image lag is " + std::to_string(lag_s) + " s, must be less than the sweep's " +
                    std::to_string(sweep.frame_times_s.back() - sweep.frame_times_s.front()) +
                    " s: no frame has a pose then");
  return corrected;
}

}  // namespace usct
