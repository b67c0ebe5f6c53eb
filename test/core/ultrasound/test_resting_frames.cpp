#include <gtest/gtest.h>

#include <limits>

#include "core/registration/symmetric_sweeps.h"
#include "core/ultrasound/sample_index.h"
#include "ultrasound/resting_frames.h"
#include "with_threads.h"

namespace usct::test {
namespace {

BeamUltrasound patterned(const BeamGrid& beams) {
  BeamUltrasound us{beams, {}, {}};
  const std::size_t count = beams.beams.size() * static_cast<std::size_t>(beams.samples());
  for (std::size_t i = 0; i < count; ++i)
    us.brightness.push_back(static_cast<float>((i * 7919) % 251));
  return us;
}

/// The frames of this sweep in this order; each is moved along z by as much as is listed.
BeamUltrasound recorded_as(const BeamUltrasound& us, const std::vector<int>& frames,
                           const std::vector<double>& moved_mm) {
  BeamUltrasound out;
  out.beams = us.beams;
  out.beams.frames = static_cast<int>(frames.size());
  out.beams.beams.clear();
  for (std::size_t i = 0; i < frames.size(); ++i)
    for (int line = 0; line < us.beams.lines; ++line) {
      out.beams.beams.push_back(us.beams.beam(frames[i], line));
      out.beams.beams.back().origin_mm.z() += moved_mm[i];
      for (int sample = 0; sample < us.beams.samples(); ++sample) {
        const std::size_t from = at(us.beams, sample, line, frames[i]);
        out.brightness.push_back(us.brightness[from]);
        if (!us.known.empty()) out.known.push_back(us.known[from]);
      }
    }
  return out;
}

TEST(RestingFrames, AreThoseOfTrackedSweepsAloneThatLieClose) {
  EXPECT_FALSE(without_resting_frames(patterned(straight_tracked(9, 6, 12, 0.51))));
  EXPECT_TRUE(without_resting_frames(patterned(straight_tracked(9, 6, 12, 0.49))));
  EXPECT_FALSE(without_resting_frames(patterned(symmetric_motorised(9, 6, 12, 0.02, 1e-4))));
}

TEST(RestingFrames, AreAveragedAndTheOthersKeepTheirBits) {
  const BeamUltrasound us = patterned(straight_tracked(9, 6, 5, 2.0));
  const BeamUltrasound rested =
      recorded_as(us, {0, 1, 2, 3, 2, 3, 4}, {0.0, 0.0, 0.0, -2.0, 0.3, -1.7, 0.0});
  const auto moving = without_resting_frames(rested);  // places 0, 2, 4 (four times), 8 mm
  ASSERT_TRUE(moving);
  moving->validate();
  EXPECT_TRUE(moving->beams.tracked);
  ASSERT_EQ(moving->beams.frames, 4);
  const std::vector<int> alone{0, 1, -1, 4};
  for (int frame = 0; frame < 4; ++frame)
    for (int line = 0; line < us.beams.lines; ++line) {
      const Beam& beam = moving->beams.beam(frame, line);
      const int from = alone[static_cast<std::size_t>(frame)];
      const Beam& recorded = us.beams.beam(from < 0 ? 2 : from, line);
      const double moved_mm = from < 0 ? 0.15 : 0.0;
      EXPECT_NEAR(beam.origin_mm.z(), recorded.origin_mm.z() + moved_mm, from < 0 ? 1e-12 : 0.0);
      EXPECT_EQ(beam.direction, recorded.direction);
      for (int s = 0; s < us.beams.samples(); ++s) {
        const auto recorded_at = [&](int f) { return us.brightness[at(us.beams, s, line, f)]; };
        const float expected =
            from < 0 ? 0.5F * (recorded_at(2) + recorded_at(3)) : recorded_at(from);
        EXPECT_EQ(moving->brightness[at(moving->beams, s, line, frame)], expected);
      }
    }
}

TEST(RestingFrames, ASampleIsKnownWhereHalfOfThemKnowIt) {
  const BeamGrid beams = straight_tracked(2, 2, 2, 0.1);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const BeamUltrasound us{beams, {1, nan, nan, 4, 5, 6, nan, 8}, {1, 0, 0, 255, 1, 1, 0, 0}};
  const auto moving = without_resting_frames(us);
  ASSERT_TRUE(moving);
  EXPECT_EQ(moving->known, (std::vector<std::uint8_t>{1, 1, 0, 1}));
  EXPECT_EQ(moving->brightness, (std::vector<float>{3, 6, 0, 4}));
}

TEST(RestingFrames, AreNoneOfThoseThatMove) {
  EXPECT_EQ(moving_frames(symmetric_motorised(9, 6, 12, 0.02, 1e-4)), 12);
  for (const double step_mm : {0.11, 0.2, 0.6}) {  // 5 frames, 3 and one within 0.5 mm
    const BeamUltrasound us = patterned(straight_tracked(9, 6, 31, step_mm));
    EXPECT_EQ(moving_frames(us.beams), 31);
    std::vector<int> frames(200, 0);
    for (int frame = 0; frame < us.beams.frames; ++frame) frames.push_back(frame);
    const BeamUltrasound rested = recorded_as(us, frames, std::vector<double>(frames.size(), 0.0));
    EXPECT_NEAR(moving_frames(rested.beams), 31, 5) << step_mm;
  }
  EXPECT_EQ(moving_frames(straight_tracked(9, 6, 12, 0.0)), 12);
}

/// A probe that turns about its middle line moves by its first and last lines.
TEST(RestingFrames, AProbeThatTurnsDoesNotRest) {
  BeamGrid beams = straight_tracked(9, 41, 30, 0.0);
  for (int frame = 0; frame < beams.frames; ++frame)
    for (int line = 0; line < beams.lines; ++line) {
      Beam& beam = beams.beams[static_cast<std::size_t>(frame * beams.lines + line)];
      beam.origin_mm = Eigen::AngleAxisd(0.03 * frame, Eigen::Vector3d::UnitY()) * beam.origin_mm;
    }
  EXPECT_FALSE(without_resting_frames(patterned(beams)));
}

TEST(RestingFrames, SameBitsForAnyNumberOfThreads) {
  const BeamUltrasound us = patterned(straight_tracked(40, 12, 60, 0.1));
  const auto moving = [&] { return without_resting_frames(us)->brightness; };
  EXPECT_EQ(with_threads(1, moving), with_threads(3, moving));
}

}  // namespace
}  // namespace usct::test
