#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>

#include "core/registration/random_points.h"
#include "registration/evidence/paired_advantage.h"

namespace usct::test {
namespace {

using Eigen::Vector3d;
using registration::Clusters;
using registration::paired_advantage;

/// Four clusters with the sums 4, 1, 3 and 0: mean 2, variance 10/3, so t = 2 / sqrt(10/12).
TEST(PairedAdvantage, IsStudentsTOfTheClusters) {
  const std::vector<Vector3d> centres = {{1, 1, 1}, {9, 9, 9}, {11, 1, 1}, {1, -1, 1}, {1, 1, 25}};
  const std::vector<double> parts = {5, 2, 3, 4, 1};
  const std::vector<double> other = {2, 1, 2, 1, 1};
  EXPECT_NEAR(paired_advantage(parts, other, Clusters(centres, 10.0)), 2.0 / std::sqrt(10.0 / 12.0),
              1e-12);
  // One cluster per part: differences 3, 1, 1, 3, 0, mean 1.6, variance 1.8.
  EXPECT_NEAR(paired_advantage(parts, other, Clusters(centres, 2.0)), 1.6 / std::sqrt(1.8 / 5.0),
              1e-12);
}

struct AnyParts {
  std::vector<Vector3d> centres = random_points();
  std::vector<double> parts, other;
  double cluster_mm = uniform(1.0, 10.0);

  AnyParts() {
    for (std::size_t i = 0; i < centres.size(); ++i) {
      parts.push_back(uniform(0.0, 1.0));
      other.push_back(uniform(0.0, 1.0));
    }
  }
};

RC_GTEST_PROP(PairedAdvantage, ChangesItsSignIfThePosesChangePlaces, ()) {
  const AnyParts any;
  const double t = paired_advantage(any.parts, any.other, Clusters(any.centres, any.cluster_mm));
  RC_ASSERT(std::isfinite(t));
  RC_ASSERT(paired_advantage(any.other, any.parts, Clusters(any.centres, any.cluster_mm)) == -t);
  double total = 0.0;
  for (std::size_t i = 0; i < any.parts.size(); ++i) total += any.parts[i] - any.other[i];
  RC_ASSERT(std::abs(total) < 1e-9 || (t > 0.0) == (total > 0.0));
}

RC_GTEST_PROP(PairedAdvantage, DoesNotDependOnTheScaleOfTheSimilarity, ()) {
  AnyParts any;
  const double t = paired_advantage(any.parts, any.other, Clusters(any.centres, any.cluster_mm));
  const double scale = uniform(0.01, 100.0);
  for (auto* values : {&any.parts, &any.other})
    for (double& value : *values) value *= scale;
  RC_ASSERT(std::abs(paired_advantage(any.parts, any.other, Clusters(any.centres, any.cluster_mm)) -
                     t) < 1e-6 * (1.0 + std::abs(t)));
}

TEST(PairedAdvantage, PosesThatAreTheSameInEveryPartHaveNone) {
  const std::vector<Vector3d> centres = {{0, 0, 0}, {30, 0, 0}, {0, 30, 0}};
  EXPECT_EQ(paired_advantage({1, 2, 3}, {1, 2, 3}, Clusters(centres, 10.0)), 0.0);
}

TEST(PairedAdvantage, OneClusterSaysNothing) {
  EXPECT_TRUE(std::isnan(paired_advantage({1, 2}, {0, 0}, Clusters({{1, 1, 1}, {2, 2, 2}}, 10.0))));
  EXPECT_TRUE(std::isnan(paired_advantage({}, {}, Clusters({}, 10.0))));
  // A similarity that is no sum has one part, which lies nowhere.
  EXPECT_TRUE(std::isnan(paired_advantage({1}, {0}, Clusters({}, 10.0))));
}

}  // namespace
}  // namespace usct::test
