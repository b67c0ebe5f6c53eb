#include "registration/background.h"

#include <algorithm>

#include "us_ct_registration/registration/pose_parameters.h"
#include "us_ct_registration/registration/starts.h"

namespace usct::registration {

BackgroundPoses::BackgroundPoses(const Eigen::Isometry3d& T_us_ct_initial, const FieldPoints& field,
                                 const std::optional<StartOptions>& starts,
                                 const BackgroundOptions& options)
    : field_(field), away_mm_(options.away_mm) {
  StartOptions spread;
  if (starts) {
    spread = *starts;
  } else {
    spread.rotation_rad = options.spread_rad;
    spread.translation_mm = options.spread_mm;
  }
  spread.count = 1 + options.count;
  const PoseParameters pose(T_us_ct_initial, field.us_mm());
  for (const PoseVector& start : spread_starts(pose, spread))
    poses_.push_back({pose.T_us_ct(start), {}});
  poses_.erase(poses_.begin());  // the initial pose itself
}

Background BackgroundPoses::of(const Similarity& similarity, const Candidate& best,
                               Run& run) const {
  std::vector<Candidate> poses = poses_;
  evaluate(similarity, poses, run);
  std::vector<double> values;
  for (const Candidate& pose : poses)
    if (pose.has_value() && field_.distance_mm(pose.T_us_ct, best.T_us_ct) > away_mm_)
      values.push_back(pose.value);
  Background background;
  if (values.size() < 2) return background;
  std::sort(values.begin(), values.end());
  constexpr double kUpper = 0.9;
  constexpr double kUpperInDeviations = 1.2816;  // upper decile of a normal distribution
  const auto quantile = [&](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
  };
  background.median = quantile(0.5);
  background.deviation = (quantile(kUpper) - background.median) / kUpperInDeviations;
  return background;
}

}  // namespace usct::registration
