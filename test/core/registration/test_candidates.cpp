#include <gtest/gtest.h>

#include "analytic_similarity.h"
#include "registration/search/candidates.h"

namespace usct::test {
namespace {

using registration::Candidate;
using registration::rivals_of;

/// A pose that lies so far along x from the identity: so far moves every point of the field.
Candidate at(double x_mm, double value) {
  Candidate candidate;
  candidate.T_us_ct.translation().x() = x_mm;
  candidate.value = value;
  return candidate;
}

TEST(Rivals, AreTheBestThreeThatLieFarFromTheBestPose) {
  const std::vector<Candidate> optima{at(0.0, 0.9),  at(9.0, 0.8),  at(-11.0, 0.7), at(-12.0, 0.6),
                                      at(10.0, 0.5), at(30.0, 0.4), at(50.0, 0.3)};
  const std::vector<Candidate> rivals = rivals_of(optima, 10.0, cube_field());
  ASSERT_EQ(rivals.size(), 3U);
  EXPECT_EQ(rivals[0].value, 0.7);
  EXPECT_EQ(rivals[1].value, 0.6);
  EXPECT_EQ(rivals[2].value, 0.4);
}

TEST(Rivals, AreNoneWhereAllPosesAreTheBestOne) {
  EXPECT_TRUE(rivals_of({at(0.0, 0.9), at(9.0, 0.8)}, 10.0, cube_field()).empty());
}

}  // namespace
}  // namespace usct::test
