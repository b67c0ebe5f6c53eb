#include <gtest/gtest.h>

#include "core/ultrasound/turning_sweeps.h"
#include "ultrasound/sweep_motion.h"

namespace usct::test {
namespace {

constexpr int kFrames = 61;
constexpr double kStepRad = 0.02;

/// The turn of a frame if the sweep is (1 + error) times as long as it was recorded, in steps.
double stretched(int frame, double error) {
  constexpr double kMiddle = 0.5 * (kFrames - 1);
  return kMiddle + (1.0 + error) * (frame - kMiddle);
}

BeamGrid turning(double error) {
  return moved_frames(40, 61, kFrames, [&](int frame) {
    return Eigen::Isometry3d(
        Eigen::AngleAxisd(kStepRad * stretched(frame, error), Eigen::Vector3d::UnitY()));
  });
}

/// About an axis in the middle of the depths.
BeamGrid rocking(double error) {
  const BeamGrid at_rest = straight_tracked(41, 31, 1, 0.0);
  const Eigen::Translation3d to_axis(0.0, at_rest.point(0, 15, 20.0).y(), 0.0);
  return moved_frames(41, 31, kFrames, [&](int frame) {
    return to_axis *
           Eigen::AngleAxisd(kStepRad * stretched(frame, error), Eigen::Vector3d::UnitX()) *
           to_axis.inverse();
  });
}

/// The middle of the field of view stays where it is in these sweeps, so that its path says nothing
/// of how far along the sweep a frame is.
TEST(SweepMotion, FollowsAProbeThatTurnsOrRocksAboutTheMiddleOfItsField) {
  constexpr double kError = 0.1;
  for (const auto& sweep : {turning, rocking}) {
    const BeamGrid recorded = sweep(0.0), longer = sweep(kError);
    const double moved_mm = greatest_distance_mm(recorded, longer);
    EXPECT_GT(moved_mm, 1.5);
    EXPECT_LT(greatest_distance_mm(with_sweep(recorded, {0.0, kError, 0.0}), longer),
              0.1 * moved_mm);
  }
}

TEST(SweepMotion, OfAProbeAtRestIsNone) {
  const BeamGrid beams = straight_tracked(40, 31, 9, 0.0);
  const SweepMotion motion(beams);
  for (int f = 0; f < beams.frames; ++f) {
    EXPECT_EQ(motion.per_error(f, 3).origin_mm.norm(), 0.0);
    EXPECT_EQ(motion.moved(f, 3, 0.1).origin_mm, beams.beam(f, 3).origin_mm);
  }
}

}  // namespace
}  // namespace usct::test
