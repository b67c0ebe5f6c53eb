#include <gtest/gtest.h>

#include "core/similarity/patch_scenes.h"
#include "registration/evidence/acquisition_check.h"
#include "us_ct_registration/evaluation/perturbation.h"
#include "us_ct_registration/registration/registration.h"
#include "us_ct_registration/similarity/catalogue.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::AcquisitionCheck;
using registration::Candidate;
using registration::FieldPoints;

/// Ultrasound that shows a CT at the identity, and poses beside it from which a climb ends
/// elsewhere.
class CheckedPoses : public testing::Test {
 protected:
  CheckedPoses() {
    for (int f = 0; f < beams_.frames; ++f)
      for (int l = 0; l < beams_.lines; ++l)
        for (int s = 0; s < beams_.samples(); ++s) {
          const Vector3d p = beams_.point(f, l, s);
          us_->brightness.push_back(static_cast<float>(sample_at_index(
              ct_, ct_.grid.index_from_physical(p), Interpolation::kTrilinear, Outside::edge())));
          if (f % 5 == 1 && l % 5 == 1 && s % 5 == 1) points_.push_back(p);
        }
    options_.parts.optimizer.method = OptimizerMethod::kGaussNewton;
    options_.parts.optimizer.max_evaluations = 300;
    options_.parts.optimizer.initial_step = 1.0;
    options_.parts.optimizer.step_tolerance = 0.2;
    similarity_.patches = cubes(7.0);
    similarity_.channel = GradientChannel::kMagnitude;
  }

  SimilarityImages images() const { return {us_, pack_ct(ct_, kWindow, kBackgroundHu), nullptr}; }
  Isometry3d beside(std::uint64_t seed, double displacement_mm) const {
    return random_motion(seed, points_, displacement_mm, 0.2);
  }
  AcquisitionCheck check(const Candidate& judged) {
    return *registration::check_acquisition(judged, images(), similarity_, options_,
                                            FieldPoints(points_), run_);
  }
  /// Where the climbs of the check lead, whether that counts or not.
  Candidate climbed(const Isometry3d& T_us_ct, const AcquisitionErrors& limits) {
    const SimilarityImages recorded = images();
    SimilarityImages along_beams = registration::with_beams(recorded);
    const auto similarity =
        make_similarity(along_beams, on_samples(similarity_, SampleSubset::kHalf));
    OptimizerOptions optimizer = options_.parts.optimizer;
    if (limits.depth > 0.0) optimizer.initial_step = 4.0;
    std::vector<Candidate> found{{T_us_ct, {}}};
    registration::climb(*similarity, {optimizer, options_.parts.reach_mm, limits, 1},
                        FieldPoints(points_), found, run_);
    return found.front();
  }
  double distance_mm(const Isometry3d& a, const Isometry3d& b) const {
    return FieldPoints(points_).distance_mm(a, b);
  }

  const BeamGrid beams_ = downward_beams(24, 32, 28);
  const Volume<float> ct_ = wavy_ct(oblique_grid({64, 60, 56}, {1.1, 1.0, 0.9}));
  const std::shared_ptr<BeamUltrasound> us_ =
      std::make_shared<BeamUltrasound>(BeamUltrasound{beams_, {}, {}});
  std::vector<Vector3d> points_;
  LocalLc2Options similarity_;
  ConfidenceOptions options_;
  RegistrationHooks hooks_;
  registration::Run run_{hooks_};
};

/// It is compared patch by patch, and other metrics have no patches to compare.
TEST_F(CheckedPoses, AMetricWithoutPartsSaysNothing) {
  JointCorrelationRatioOptions joint;
  joint.patches = cubes(7.0);
  NccOptions ncc;
  ncc.patches = cubes(7.0);
  for (const SimilarityOptions& metric : {SimilarityOptions(joint), SimilarityOptions(ncc)})
    EXPECT_FALSE(registration::check_acquisition({Isometry3d::Identity(), {}}, images(), metric,
                                                 options_, FieldPoints(points_), run_));
}

/// A longer first step over pose and errors may lead to another optimum, such as the right pose
/// beside a wrong one. What it finds there says nothing of the pose that is checked.
TEST_F(CheckedPoses, ErrorsAreThoseOfTheOptimumThatIsChecked) {
  int left = 0, stayed = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const Isometry3d start = beside(seed, 12.0);
    const Candidate recorded = climbed(start, {});
    const Candidate with_errors = climbed(start, {0.15, 0.15, 0.15});
    // An error of the depths displaces a pose, here as far as the climb without errors.
    const AcquisitionCheck found = check({start, {1.0, 0.0}});
    const double moved_mm = distance_mm(with_errors.T_us_ct, recorded.T_us_ct);
    if (moved_mm > 10.0) {
      ++left;
      EXPECT_EQ(found.errors.depth, 0.0) << seed;
      EXPECT_EQ(found.errors.sweep, 0.0) << seed;
      EXPECT_EQ(found.errors.unevenness, 0.0) << seed;
      EXPECT_EQ(found.ratio, 1.0) << seed;
      EXPECT_EQ(found.advantage, 0.0) << seed;
      EXPECT_LT(distance_mm(found.T_us_ct, recorded.T_us_ct), 1e-6) << seed;
    } else if (moved_mm < 1.0) {
      ++stayed;
      EXPECT_NE(found.ratio, 1.0) << seed;
      EXPECT_LT(distance_mm(found.T_us_ct, recorded.T_us_ct), 4.0) << seed;
    }
  }
  EXPECT_GT(left, 0);
  EXPECT_GT(stayed, 50);
}

/// What a climb finds far from a pose speaks for another pose, with errors or without.
TEST_F(CheckedPoses, APoseThatIsNoOptimumHasNoErrors) {
  int far = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Isometry3d start = beside(seed, 12.0);
    if (distance_mm(climbed(start, {}).T_us_ct, start) < 5.0) continue;
    ++far;
    const AcquisitionCheck found = check({start, {}});
    EXPECT_EQ(found.errors.depth, 0.0) << seed;
    EXPECT_EQ(found.errors.sweep, 0.0) << seed;
    EXPECT_EQ(found.ratio, 1.0) << seed;
    EXPECT_LT(distance_mm(found.T_us_ct, start), 1e-6) << seed;
  }
  EXPECT_GT(far, 20);
}

}  // namespace
}  // namespace usct::test
