#pragma once

#include <cmath>
#include <vector>

#include "registration/search/candidates.h"
#include "similarity/pose_by_pose.h"

/// A similarity without images: a sum of peaks at known poses.
namespace usct::test {

/// Points on the corners and in the middle of a cube of 60 mm, 80 mm in front of the probe.
inline registration::FieldPoints cube_field() {
  std::vector<Eigen::Vector3d> points;
  for (const double x : {-30.0, 0.0, 30.0})
    for (const double y : {50.0, 80.0, 110.0})
      for (const double z : {-30.0, 0.0, 30.0}) points.emplace_back(x, y, z);
  return registration::FieldPoints(points);
}

struct Peak {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  double height = 1.0;
  double width_mm = 10.0;
};

/// `height exp(-d^2 / 2 width^2)` of each peak, d being the distance of the field of view; a pose
/// at no peak has the value 0.
class PeaksSimilarity final : public PoseByPose {
 public:
  PeaksSimilarity(registration::FieldPoints field, std::vector<Peak> peaks)
      : field_(std::move(field)), peaks_(std::move(peaks)) {}

 private:
  SimilarityValue value_at(const SimilarityPose& pose) const override {
    SimilarityValue result{0.0, 1.0};
    for (const Peak& peak : peaks_) {
      const double d = field_.distance_mm(pose.T_ct_us.inverse(), peak.T_us_ct) / peak.width_mm;
      result.value += peak.height * std::exp(-0.5 * d * d);
    }
    return result;
  }

  registration::FieldPoints field_;
  std::vector<Peak> peaks_;
};

/// A similarity that has no value anywhere.
class NoSimilarity final : public PoseByPose {
 private:
  SimilarityValue value_at(const SimilarityPose& /*pose*/) const override { return {}; }
};

}  // namespace usct::test
