#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/evaluation/fiducial_matching.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

const Points kOfUnequalDistances{{0, 0, 0}, {40, 5, -3}, {-8, 55, 10}, {15, 20, 60}, {50, 45, 30}};

/// The points in a random order; `order[i]` is where point i of the result was.
std::pair<Points, std::vector<std::size_t>> shuffled(const Points& points) {
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  for (std::size_t i = order.size() - 1; i > 0; --i)
    std::swap(order[i], order[static_cast<std::size_t>(integer(0, static_cast<int>(i)))]);
  Points result;
  for (const std::size_t i : order) result.push_back(points[i]);
  return {result, order};
}

RC_GTEST_PROP(FiducialMatching, FindsTheOrderInSpiteOfNoiseAndOfFurtherPoints, ()) {
  const Isometry3d T = random_pose(200.0);
  Points us = moved(T, kOfUnequalDistances);
  for (Vector3d& p : us) p += random_vector(0.4);
  for (int i = integer(0, 2); i > 0; --i) us.push_back(T * random_vector(300.0));
  const auto [unordered, order] = shuffled(us);
  const FiducialMatching matching = match_fiducials(unordered, kOfUnequalDistances, 0.7);
  RC_ASSERT(matching.fitting[0].pairs.size() == kOfUnequalDistances.size());
  if (!matching.ambiguous())
    for (const auto& [i, j] : matching.fitting[0].pairs) RC_ASSERT(order[i] == j);
  // A further point may take the place of a fiducial only where it happens to lie there.
  RC_ASSERT(!matching.ambiguous() || us.size() > kOfUnequalDistances.size());
  RC_ASSERT(matching.fitting[0].fre_mm < 0.7);
  // The same with the roles of the images exchanged.
  const FiducialMatching swapped = match_fiducials(kOfUnequalDistances, unordered, 0.7);
  RC_ASSERT(swapped.fitting.size() == matching.fitting.size());
  const auto points = matched_points(matching.fitting[0], unordered, kOfUnequalDistances);
  RC_ASSERT(points.first.size() == points.second.size());
}

/// The numbers of proper rotations that map a rectangle, an equilateral triangle and a regular
/// tetrahedron to themselves are 4, 6 and 12.
TEST(FiducialMatching, SymmetricArrangementsAreAmbiguous) {
  const Points rectangle{{0, 0, 0}, {40, 0, 0}, {40, 20, 0}, {0, 20, 0}};
  EXPECT_EQ(match_fiducials(rectangle, rectangle, 0.5).fitting.size(), 4U);
  EXPECT_TRUE(match_fiducials(rectangle, rectangle, 0.5).ambiguous());
  const Points triangle{{20, 0, 0}, {-10, 10 * std::sqrt(3.0), 0}, {-10, -10 * std::sqrt(3.0), 0}};
  EXPECT_EQ(match_fiducials(triangle, triangle, 0.5).fitting.size(), 6U);
  const Points tetrahedron{{20, 20, 20}, {20, -20, -20}, {-20, 20, -20}, {-20, -20, 20}};
  EXPECT_EQ(match_fiducials(tetrahedron, tetrahedron, 0.5).fitting.size(), 12U);
  // A difference of 2 mm in one edge tells, if the localization is good enough.
  Points uneven = rectangle;
  uneven[2].x() += 2.0;
  EXPECT_FALSE(match_fiducials(uneven, uneven, 0.1).ambiguous());
  EXPECT_TRUE(match_fiducials(uneven, uneven, 2.0).ambiguous());
}

/// Mutual distances do not tell a set of points from its mirror image; the alignment does.
TEST(FiducialMatching, AMirroredSetIsRefused) {
  Points mirrored = kOfUnequalDistances;
  for (Vector3d& p : mirrored) p.x() = -p.x();
  expect_input_error([&] { match_fiducials(mirrored, kOfUnequalDistances, 1.0); },
                     {"no pairing of 5", "with 5", "1 mm"});
}

/// With an error as large as the distances of the points, all of 40! / 32! pairings fit.
TEST(FiducialMatching, AnErrorForWhichAlmostAllPairingsFitIsRefused) {
  Points few;
  Points many;
  for (int i = 0; i < 40; ++i) many.emplace_back(7 * i % 40, 11 * i % 40, 17 * i % 40);
  for (int i = 0; i < 8; ++i) few.push_back(many[static_cast<std::size_t>(3 * i)]);
  expect_input_error([&] { match_fiducials(few, many, 30.0, "points"); },
                     {"points", "too many pairings", "30 mm"});
}

TEST(FiducialMatching, BadInputIsNamed) {
  expect_input_error([] { match_fiducials(Points(9), Points(9), 1.0); }, {"9 and 9", "at most 8"});
  expect_input_error(
      [] {
        match_fiducials({{0, 0, 0}, {1, 0, 0}}, kOfUnequalDistances, 1.0);
      },
      {"2 points, must be at least 3"});
  expect_input_error([] { match_fiducials(kOfUnequalDistances, kOfUnequalDistances, 0.0); },
                     {"localization error is 0 mm"});
}

}  // namespace
}  // namespace usct::test
