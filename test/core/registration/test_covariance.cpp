#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/registration/registration_cases.h"

namespace usct::test {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

RegistrationResult of(const RegistrationCase& images,
                      const RegistrationOptions& options = quick_options()) {
  const RegistrationResult result = registered(images, nearby(images), options);
  EXPECT_TRUE(result.T_us_ct) << result.message;
  EXPECT_TRUE(result.covariance);
  return result;
}

double expected_mm(const RegistrationResult& result) {
  return result.measures.at("expected_error_mm");
}

TEST(Covariance, IsSymmetricAndPositiveDefinite) {
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    const Matrix6d covariance = *of(*images).covariance;
    EXPECT_EQ(covariance, covariance.transpose());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(covariance).eigenvalues().minCoeff(), 0.0);
  }
}

TEST(Covariance, WidensAsTheOptionsSay) {
  const auto expected = [](double factor, double systematic) {
    RegistrationOptions options = quick_options();
    options.confidence.deviation_factor = factor;
    options.confidence.systematic_mm = systematic;
    options.confidence.max_expected_error_mm = 100.0;
    return expected_mm(of(agar_case(), options));
  };
  const double of_patches_mm = expected(1.0, 0.0);
  EXPECT_GT(of_patches_mm, 0.0);
  EXPECT_NEAR(expected(2.0, 0.0), 2.0 * of_patches_mm, 1e-9);
  EXPECT_NEAR(expected(1.0, 3.0), std::hypot(of_patches_mm, 3.0), 1e-6);
}

}  // namespace
}  // namespace usct::test
