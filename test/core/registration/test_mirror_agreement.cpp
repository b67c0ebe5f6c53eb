#include <gtest/gtest.h>

#include "core/registration/analytic_similarity.h"
#include "core/registration/symmetric_sweeps.h"
#include "core/registration/wishes.h"
#include "registration/evidence/mirror_agreement.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::Decoy;

/// Where the decoys fit best, and where the search found them: near there.
const Isometry3d kFits(Eigen::Translation3d(6.0, -5.0, 4.0));
const Isometry3d kFound = Eigen::Translation3d(1.5, -1.0, 1.0) * kFits;

Decoy decoy_of(Mirror mirror) {
  return {mirror,
          registration::mirror_of(mirror, symmetric_motorised(40, 9, 9, 0.05, 0.05),
                                  cube_field().centre_us_mm()),
          {kFound, {}},
          {}};
}

/// Where clusters of the ultrasound wish to be moved to, as those of the mirrored ultrasound see
/// it.
Vector3d wished_by(Mirror mirror, const Vector3d& at_mm) {
  return decoy_of(mirror).T_mirror * at_mm;
}

std::optional<double> agreement(const std::vector<Mirror>& mirrors, const Similarity& asked) {
  std::vector<Decoy> decoys;
  std::vector<Peak> peaks;
  for (const Mirror mirror : mirrors) {
    decoys.push_back(decoy_of(mirror));
    peaks.push_back({decoys.back().T_mirror * kFits, 1.0, 6.0});
  }
  PartOptions how;
  how.optimizer.method = OptimizerMethod::kBobyqa;
  how.optimizer.max_evaluations = 300;
  how.optimizer.initial_step = 1.0;
  how.optimizer.step_tolerance = 1e-4;
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  return registration::mirror_agreement(
      decoys, PeaksSimilarity(cube_field(), peaks), asked, how, {},
      {kClusterMm, kStepMm, {Vector3d::Zero(), 1000.0, Vector3d::UnitZ()}}, cube_field(), run);
}

/// The clusters are asked where the mirrored ultrasound fits best. At the pose that the search
/// found, each would rather lie elsewhere.
TEST(MirrorAgreement, IsThatOfThePoseToWhichTheMirroredUltrasoundClimbs) {
  for (const Mirror mirror : {Mirror::kLines, Mirror::kFrames, Mirror::kHalfTurn}) {
    const Wishes content(std::vector<Vector3d>(5, wished_by(mirror, kFits.translation())));
    EXPECT_NEAR(agreement({mirror}, content).value(), 1.0 - by_chance(5), 1e-3);
  }
}

TEST(MirrorAgreement, IsTheMostOfAllMirrorImages) {
  const Wishes content_if_lines_are_reversed(
      std::vector<Vector3d>(5, wished_by(Mirror::kLines, kFits.translation())));
  const double least = agreement({Mirror::kFrames}, content_if_lines_are_reversed).value();
  EXPECT_LT(least, 0.3);
  for (const std::vector<Mirror>& mirrors :
       {std::vector<Mirror>{Mirror::kFrames, Mirror::kLines}, {Mirror::kLines, Mirror::kFrames}})
    EXPECT_NEAR(agreement(mirrors, content_if_lines_are_reversed).value(), 1.0 - by_chance(5),
                1e-3);
}

TEST(MirrorAgreement, IsAbsentWithoutMirrorImagesOrParts) {
  EXPECT_FALSE(agreement({}, Wishes({Vector3d::Zero()})));
  EXPECT_FALSE(agreement({Mirror::kLines}, Wishes({})));
}

}  // namespace
}  // namespace usct::test
