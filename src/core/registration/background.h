#pragma once

#include "registration/candidates.h"

namespace usct::registration {

/// Background of a similarity: the median of its values at poses where nothing fits, and the
/// deviation of a normal distribution with the same upper decile (a few poses fit a little, so the
/// tail is long).
struct Background {
  double median = 0.0;
  double deviation = 0.0;

  /// Height of a value above the median, in deviations.
  double significance(double value) const {
    return deviation > 0.0 ? (value - median) / deviation : 0.0;
  }
};

/// Poses spread like the starts around the initial pose, the same for every similarity.
class BackgroundPoses {
 public:
  BackgroundPoses(const Eigen::Isometry3d& T_us_ct_initial, const FieldPoints& field,
                  const std::optional<StartOptions>& starts, const BackgroundOptions& options);

  /// The background without the poses near `best`, whose similarity may be raised by it.
  Background of(const Similarity& similarity, const Candidate& best, Run& run) const;

 private:
  const FieldPoints& field_;
  double away_mm_;
  std::vector<Candidate> poses_;
};

}  // namespace usct::registration
