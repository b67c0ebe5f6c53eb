#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "core/registration/registration_cases.h"
#include "registration/attempts/attempt.h"
#include "registration/evidence/evidence.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::Assessment;
using registration::Candidate;

/// The evidence for a pose 3 mm beside the truth, with a rival far from it. The middle of the field
/// is at (110, 110, 110) mm, and all of it within 100 mm of there.
Assessment assessed(double cluster_mm) {
  const Isometry3d motion(
      Eigen::Translation3d(Vector3d::Constant(110.0) - middle_us_mm(agar_case())));
  const RegistrationCase images = moved(agar_case(), motion, Isometry3d::Identity());
  RegistrationOptions options = quick_options();
  options.confidence.cluster_mm = cluster_mm;
  // Nothing but the deformation of tissue, and the sweep and the depths that the images show.
  ErrorOptions& error = options.confidence.error;
  error.parts_factor = 1e-9;
  error.sound_speed_share = error.sweep_share = error.lag_frames = error.other_mm = 0.0;
  const Isometry3d initial = beside_truth(images, {0, 0, 0}, {3, 0, 0});
  const PreparedCt ct(images.ct);
  const registration::RegistrationInput input{images.us, ct, initial, options};
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  const registration::ImagePyramid pyramid = *registration::prepare(input, run);
  const registration::Attempt attempt = registration::attempt_on(pyramid, input, run);
  std::vector<Candidate> optima{{initial, {}}, {beside_truth(images, {0, 0, 0}, {0, 30, 0}), {}}};
  registration::evaluate(pyramid.deciding(), optima, run);
  registration::Evidence evidence(
      {images.us, ct.ct(), pyramid, attempt.problem, options.confidence});
  evidence.take_over({});  // no search for mirror images
  Assessment assessment;
  evidence.compare(optima, assessment, run);
  evidence.check(optima.front(), assessment, run);
  return assessment;
}

/// A cube from 0 to 300 mm has the whole field, one from 0 to 150 mm a part of it.
const Assessment& in_one_cluster() {
  static const Assessment one = assessed(300.0);
  return one;
}
const Assessment& in_some_clusters() {
  static const Assessment some = assessed(150.0);
  return some;
}

/// What a single cluster gains is as much as its own error.
TEST(Evidence, AsksClustersThatAreAsLargeAsTheOptionsSay) {
  EXPECT_NEAR(std::abs(in_one_cluster().measures.local_advantage.value()), 1.0, 1e-9);
  EXPECT_GT(std::abs(std::abs(in_some_clusters().measures.local_advantage.value()) - 1.0), 1e-3);
}

/// Student's t needs two of them. One says nothing, and not that the pose is better beyond measure.
TEST(Evidence, ComparesPosesByClustersThatAreAsLargeAsTheOptionsSay) {
  EXPECT_TRUE(std::isnan(in_one_cluster().measures.rival_advantage.value()));
  EXPECT_TRUE(std::isfinite(in_some_clusters().measures.rival_advantage.value()));
}

/// The middle of the cluster is 69 mm from that of the field, but it reaches there.
TEST(Evidence, MotionOfTissueIsThatOfClustersThatReachIntoTheRegionOfTheExpectedError) {
  EXPECT_GT(in_one_cluster().measures.tissue_motion_mm.value(), 1.0);
}

/// A shift of root mean square length d in any direction has the variance d^2 / 3 along each. What
/// the images show of the sweep and the depths adds to two directions.
TEST(Evidence, TheDeformationOfTissueIsAnErrorInEveryDirection) {
  const double deformation_mm = in_one_cluster().measures.deformation_mm.value();
  ASSERT_GT(deformation_mm, 0.5);
  const Eigen::Matrix3d of_shifts = in_one_cluster().covariance.value().bottomRightCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(of_shifts);
  EXPECT_NEAR(eigen.eigenvalues().minCoeff(), deformation_mm * deformation_mm / 3.0, 1e-6);
  EXPECT_GE(in_one_cluster().measures.expected_error_mm.value(), deformation_mm - 1e-6);
}

}  // namespace
}  // namespace usct::test
