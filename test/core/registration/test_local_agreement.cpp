#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <vector>

#include "core/geometry/random_geometry.h"
#include "registration/local_agreement.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::local_agreement;

constexpr double kClusterMm = 10.0;
constexpr double kStepMm = 4.0;

/// A part in each of some clusters of 10 mm, and the place at which it would rather lie: its
/// contribution falls with the distance from there.
class Wishes final : public Similarity {
 public:
  explicit Wishes(std::vector<Vector3d> wished_mm) : wished_mm_(std::move(wished_mm)) {}

  using Similarity::evaluate;
  void evaluate(const SimilarityPose* /*poses*/, std::size_t /*count*/, SimilarityValue* /*values*/,
                const Check& /*check*/) const override {}
  std::vector<double> parts(const SimilarityPose& pose) const override {
    const Vector3d moved_mm = pose.T_ct_us.inverse().translation();
    std::vector<double> result;
    for (const Vector3d& wished : wished_mm_)
      result.push_back(scale_ * std::exp(-(moved_mm - wished).norm() / kStepMm));
    return result;
  }
  std::vector<Vector3d> part_centres_us_mm() const override {
    std::vector<Vector3d> centres;
    for (std::size_t i = 0; i < wished_mm_.size(); ++i)
      centres.emplace_back(kClusterMm * (static_cast<double>(i) + 0.5), 5.0, 5.0);
    return centres;
  }
  Wishes times(double scale) const {
    Wishes result = *this;
    result.scale_ = scale;
    return result;
  }

 private:
  std::vector<Vector3d> wished_mm_;
  double scale_ = 1.0;
};

std::optional<double> agreement(const Similarity& similarity,
                                const Isometry3d& T_us_ct = Isometry3d::Identity()) {
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  return local_agreement(similarity, T_us_ct, kClusterMm, kStepMm, run);
}

/// The share that chance makes up among so many clusters.
double by_chance(int clusters) { return 1.0 / std::sqrt(clusters); }

Isometry3d shift(const Vector3d& shift_mm) { return Isometry3d(Eigen::Translation3d(shift_mm)); }

RC_GTEST_PROP(LocalAgreement, IsWholeIfAllClustersWishThePose, ()) {
  const Vector3d pose_mm = random_pose(20.0).translation();
  const Wishes wishes(std::vector<Vector3d>(5, pose_mm));
  RC_ASSERT(std::abs(agreement(wishes, shift(pose_mm)).value() - (1.0 - by_chance(5))) < 1e-9);
}

/// At a distance of sqrt(3) steps a cluster that wishes a corner is about as well off as on
/// average.
TEST(LocalAgreement, FallsWithTheShareOfClustersThatWishToLieElsewhere) {
  const Vector3d corner_mm(kStepMm, kStepMm, -kStepMm);
  double before = 1.0;
  for (std::size_t others = 0; others <= 4; ++others) {
    std::vector<Vector3d> wished(4, Vector3d::Zero());
    std::fill_n(wished.begin(), others, corner_mm);
    const double now = agreement(Wishes(wished)).value();
    EXPECT_LT(now, before);
    before = now;
  }
  EXPECT_LT(before + by_chance(4), 0.05);
}

/// By hand: a cluster wishes (4, 0, 0). Its contributions are exp(-d) for 27 distances d (in steps)
/// on a lattice of which it wishes the middle of a face.
TEST(LocalAgreement, IsTheShareOfTheRiseInReachLessWhatChanceMakesUp) {
  double sum = 0.0;
  for (const int x : {0, 1, 2})
    for (const int y : {-1, 0, 1})
      for (const int z : {-1, 0, 1}) sum += std::exp(-std::sqrt(x * x + y * y + z * z));
  const double mean = sum / 27.0;
  EXPECT_NEAR(agreement(Wishes({{kStepMm, 0.0, 0.0}})).value(),
              (std::exp(-1.0) - mean) / (1.0 - mean) - by_chance(1), 1e-9);
}

RC_GTEST_PROP(LocalAgreement, DoesNotDependOnTheScaleOfTheSimilarity, ()) {
  std::vector<Vector3d> wished;
  for (int i = 0; i < 6; ++i) wished.push_back(random_pose(6.0).translation());
  const Wishes wishes(wished);
  const double scale = uniform(0.01, 100.0);
  RC_ASSERT(std::abs(agreement(wishes).value() - agreement(wishes.times(scale)).value()) < 1e-9);
}

TEST(LocalAgreement, SimilaritiesWithoutPartsOrDifferencesSayNothing) {
  EXPECT_FALSE(agreement(Wishes({})));
  EXPECT_FALSE(agreement(Wishes({Vector3d::Zero()}).times(0.0)));
}

}  // namespace
}  // namespace usct::test
