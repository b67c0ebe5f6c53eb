#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/ultrasound/turning_sweeps.h"
#include "ultrasound/decimation.h"
#include "ultrasound/gaussian_sums.h"
#include "ultrasound/moving_place.h"

namespace usct::test {
namespace {

void expect_middle(const BeamGrid& beams) {
  const MeasuredPlace place = moving_place(beams);
  EXPECT_EQ(place.line, beams.lines / 2);
  EXPECT_EQ(place.sample, 0.5 * (beams.samples() - 1));
}

TEST(MovingPlace, IsTheMiddleOfStraightSweepsAndOfFans) {
  expect_middle(straight_tracked(40, 31, 20, 1.0));
  expect_middle(straight_tracked(40, 31, 1, 1.0));
  expect_middle(straight_tracked(40, 31, 20, 0.0));
  for (const double pitch_rad : {0.01, 0.05})
    expect_middle(symmetric_motorised(60, 41, 25, 0.03, pitch_rad));
  // A fan about the surface of the array: the deepest sample moves twice as far.
  expect_middle(rocking_sweep(40, 31, 20, 0.02, 0.0));
}

/// Lines lie from one side of the axis to the other: the median of their distances from it is half
/// of the greatest.
TEST(MovingPlace, IsHalfwayToTheSideOfASweepThatTurnsAboutItsMiddleLine) {
  for (const int lines : {60, 61}) {
    const BeamGrid beams = turning_sweep(40, lines, 90, 0.035);
    const Eigen::Vector3d p_mm = beams.point(0, moving_place(beams).line, 0.0);
    EXPECT_NEAR(std::abs(p_mm.x()), 15.0, 0.5);
  }
}

TEST(MovingPlace, IsHalfwayToAnEndOfASweepThatRocksAboutTheMiddleOfItsDepths) {
  const BeamGrid beams = rocking_sweep(41, 31, 20, 0.02, 30.0);
  EXPECT_NEAR(std::abs(moving_place(beams).sample - 20.0), 10.0, 1e-9);
}

/// Frames are 0.525 mm apart, 15 mm beside the axis.
TEST(MovingPlace, IsWhereFactorsComeClosestToASpacing) {
  EXPECT_EQ(factors_for_spacing(turning_sweep(40, 61, 90, 0.035), 2.1).z(), 4);
  EXPECT_EQ(factors_for_spacing(rocking_sweep(41, 31, 90, 0.035, 30.0), 2.1).z(), 4);
}

/// Lines are 1 mm apart; 15 mm beside the axis, frames are 0.525 mm apart.
TEST(MovingPlace, IsWhereFramesHaveTheirSpacing) {
  const BeamSpacing straight = mean_spacing_mm(straight_tracked(40, 31, 20, 1.5));
  EXPECT_NEAR(straight.line_mm, 1.0, 1e-9);
  EXPECT_NEAR(straight.frame_mm, 1.5, 1e-9);
  const BeamSpacing turning = mean_spacing_mm(turning_sweep(40, 61, 90, 0.035));
  EXPECT_NEAR(turning.line_mm, 1.0, 1e-9);
  EXPECT_NEAR(turning.frame_mm, 0.525, 0.02);
  const BeamSpacing alone = mean_spacing_mm(straight_tracked(40, 31, 1, 1.5));
  EXPECT_NEAR(alone.line_mm, 1.0, 1e-9);
  EXPECT_EQ(alone.frame_mm, 0.0);
}

/// All frames share the middle line, and none but neighbours have anything else in common.
TEST(MovingPlace, IsWhereGaussianSumsTakeTheDistanceOfFrames) {
  const BeamGrid beams = turning_sweep(12, 61, 90, 0.035);
  std::vector<float> values(beams.beams.size() * static_cast<std::size_t>(beams.samples()));
  const auto per_frame = static_cast<std::size_t>(beams.lines * beams.samples());
  std::fill_n(values.begin(), per_frame, 1.0F);
  const std::vector<float> sums = GaussianSums(beams, 4.0)(values);
  for (std::size_t i = 45 * per_frame; i < 46 * per_frame; ++i) ASSERT_EQ(sums[i], 0.0F);
  EXPECT_GT(sums[per_frame], 0.0F);
}

}  // namespace
}  // namespace usct::test
