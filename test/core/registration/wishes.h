#pragma once

#include <cmath>
#include <vector>

#include "us_ct_registration/similarity/similarity.h"

/// A similarity without images, whose clusters have known wishes.
namespace usct::test {

constexpr double kClusterMm = 10.0;
constexpr double kStepMm = 4.0;

/// A part in each of some clusters of 10 mm, and the place at which it would rather lie: its
/// contribution falls with the distance from there. All are equally strong if no strengths are
/// given.
class Wishes final : public Similarity {
 public:
  explicit Wishes(std::vector<Eigen::Vector3d> wished_mm) : wished_mm_(std::move(wished_mm)) {
    strengths_.assign(wished_mm_.size(), 1.0);
  }
  Wishes(std::vector<Eigen::Vector3d> wished_mm, std::vector<double> strengths)
      : wished_mm_(std::move(wished_mm)), strengths_(std::move(strengths)) {}

  using Similarity::evaluate;
  void evaluate(const SimilarityPose* /*poses*/, std::size_t /*count*/, SimilarityValue* /*values*/,
                const Check& /*check*/) const override {}
  std::vector<double> parts(const SimilarityPose& pose) const override {
    const Eigen::Vector3d moved_mm = pose.T_ct_us.inverse().translation();
    std::vector<double> result;
    for (std::size_t i = 0; i < wished_mm_.size(); ++i)
      result.push_back(strengths_[i] * std::exp(-(moved_mm - wished_mm_[i]).norm() / kStepMm));
    return result;
  }
  std::vector<Eigen::Vector3d> part_centres_us_mm() const override {
    std::vector<Eigen::Vector3d> centres;
    for (std::size_t i = 0; i < wished_mm_.size(); ++i)
      centres.emplace_back(kClusterMm * (static_cast<double>(i) + 0.5), 5.0, 5.0);
    return centres;
  }
  Wishes times(double scale) const {
    Wishes result = *this;
    for (double& strength : result.strengths_) strength *= scale;
    return result;
  }

 private:
  std::vector<Eigen::Vector3d> wished_mm_;
  std::vector<double> strengths_;
};

/// The share that chance makes up among so many clusters.
inline double by_chance(int clusters) { return 1.0 / std::sqrt(clusters); }

}  // namespace usct::test
