#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/registration/symmetric_sweeps.h"
#include "core/ultrasound/sample_index.h"
#include "ultrasound/probe_path.h"
#include "ultrasound/stray_frames.h"
#include "us_ct_registration/error.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

void move(BeamGrid& beams, int frame, const Isometry3d& motion) {
  for (int line = 0; line < beams.lines; ++line) {
    Beam& beam = beams.beams[static_cast<std::size_t>(frame * beams.lines + line)];
    beam.origin_mm = motion * beam.origin_mm;
    beam.direction = motion.linear() * beam.direction;
  }
}

void move(BeamGrid& beams, int frame, const Vector3d& by_mm) {
  move(beams, frame, Isometry3d(Eigen::Translation3d(by_mm)));
}

Vector3d drawn_mm(double length_mm) { return length_mm * (random_rotation() * Vector3d::UnitX()); }

/// A probe that goes back and forth by up to 5 mm in a frame, and wanders meanwhile.
BeamGrid back_and_forth(int frames) {
  BeamGrid beams = straight_tracked(9, 6, frames, 0.0);
  const double step_mm = uniform(0.0, 5.0);
  const double turn = uniform(8.0, frames);
  Vector3d at_mm = Vector3d::Zero();
  for (int frame = 0; frame < frames; ++frame) {
    const bool back = std::fmod(frame, 2.0 * turn) > turn;
    at_mm += Vector3d(0.0, 0.0, back ? -step_mm : step_mm) + drawn_mm(0.5);
    move(beams, frame, at_mm);
  }
  return beams;
}

RC_GTEST_PROP(StrayFrames, AreThoseOffThePath, ()) {
  const int frames = integer(40, 200);
  BeamGrid beams = back_and_forth(frames);
  RC_ASSERT(stray_frames(beams).empty());
  std::set<int> moved;
  for (int i = integer(0, frames / 20); i > 0; --i)
    moved.insert(4 + 8 * integer(0, frames / 8 - 1));
  for (const int frame : moved) move(beams, frame, drawn_mm(uniform(60.0, 1e5)));
  RC_ASSERT(stray_frames(beams) == std::vector<int>(moved.begin(), moved.end()));
}

TEST(StrayFrames, AJumpIsNamedByTheNumbersThatItsFramesHad) {
  BeamGrid beams = straight_tracked(9, 6, 60, 0.7);
  for (int frame = 31; frame < 60; ++frame) move(beams, frame, {0.0, 0.0, 300.0});
  try {
    require_no_jump(beams, "sweep", {3, 10});  // which were left out before
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("frames 32 and 33 lie 301 mm apart"),
              std::string::npos)
        << error.what();
  }
}

TEST(StrayFrames, AJumpIsMoreThanTwoHundredMillimetres) {
  const auto require = [](double step_mm) {
    BeamGrid beams = straight_tracked(9, 6, 60, 0.0);
    for (int frame = 31; frame < 60; ++frame) move(beams, frame, {0.0, 0.0, step_mm});
    require_no_jump(beams, "sweep");
  };
  EXPECT_NO_THROW(require(199.9));
  EXPECT_THROW(require(200.1), InputError);
}

TEST(StrayFrames, MayFollowEachOther) {
  BeamGrid beams = straight_tracked(9, 6, 60, 0.7);
  for (const int frame : {1, 20, 21, 22, 58}) move(beams, frame, {300.0, 0.0, 0.0});
  EXPECT_EQ(stray_frames(beams), (std::vector<int>{1, 20, 21, 22, 58}));
}

/// Images and poses were lost, or the hand was fast for a moment; near an end too.
TEST(StrayFrames, AreNoneWhereTheProbeMovesFastOrJumps) {
  for (const double fast_mm : {12.0, 25.0, 60.0})
    for (const int begin : {1, 30, 57})
      for (const int steps : {1, 5}) {
        BeamGrid beams = straight_tracked(9, 6, 60, 0.7);
        for (int frame = begin; frame < 60; ++frame)
          move(beams, frame, {fast_mm * std::min(steps, frame - begin + 1), 0.0, 0.0});
        EXPECT_TRUE(stray_frames(beams).empty()) << fast_mm << ' ' << begin << ' ' << steps;
      }
}

/// The frame at which it turns is far from those before and after, and these lie on each other.
TEST(StrayFrames, AreNoneWhereAFastProbeTurnsBack) {
  for (const double step_mm : {8.0, 12.0, 18.0}) {
    BeamGrid beams = straight_tracked(9, 6, 121, 0.0);
    for (int frame = 0; frame < 121; ++frame)
      move(beams, frame, {0.0, 0.0, step_mm * std::abs(frame % 40 - 20)});
    EXPECT_TRUE(stray_frames(beams).empty()) << step_mm;
  }
}

TEST(StrayFrames, AWrongOrientationIsOne) {
  BeamGrid beams = straight_tracked(40, 6, 60, 0.7);
  move(beams, 30, Isometry3d(Eigen::AngleAxisd(0.5, Vector3d::UnitZ())));
  EXPECT_EQ(stray_frames(beams), std::vector<int>{30});
}

/// Three strips side by side, each begun where the one before began.
TEST(StrayFrames, AreNoneWhereTheProbeGoesOnElsewhere) {
  BeamGrid beams = straight_tracked(9, 6, 60, 0.0);
  for (int frame = 0; frame < 60; ++frame)
    move(beams, frame, {40.0 * (frame / 20), 0.0, 3.0 * (frame % 20)});
  EXPECT_TRUE(stray_frames(beams).empty());
}

TEST(StrayFrames, AreNoneWhereTheOrderIsThatOfNoPath) {
  BeamGrid beams = straight_tracked(9, 6, 60, 0.0);
  for (int frame = 0; frame < 60; ++frame) move(beams, frame, {0.0, 0.0, 3.0 * (7 * frame % 60)});
  EXPECT_TRUE(stray_frames(beams).empty());
}

TEST(StrayFrames, AreNoneOfAMotor) {
  BeamGrid beams = symmetric_motorised(9, 6, 60, 0.02, 0.01);
  move(beams, 30, {300.0, 0.0, 0.0});
  EXPECT_TRUE(stray_frames(beams).empty());
}

TEST(StrayFrames, TheOthersKeepTheirBits) {
  BeamUltrasound us{straight_tracked(9, 6, 5, 2.0), {}, {}};
  for (std::size_t i = 0; i < us.beams.beams.size() * 9; ++i) {
    us.brightness.push_back(static_cast<float>(i));
    us.known.push_back(i % 3 != 0);
  }
  const BeamUltrasound left = without_frames(us, {0, 3});
  left.validate();
  ASSERT_EQ(left.beams.frames, 3);
  EXPECT_TRUE(left.beams.tracked);
  const std::vector<int> kept{1, 2, 4};
  for (int frame = 0; frame < 3; ++frame)
    for (int line = 0; line < 6; ++line) {
      const int from = kept[static_cast<std::size_t>(frame)];
      EXPECT_EQ(left.beams.beam(frame, line).origin_mm, us.beams.beam(from, line).origin_mm);
      for (int s = 0; s < 9; ++s) {
        EXPECT_EQ(left.brightness[at(left.beams, s, line, frame)],
                  us.brightness[at(us.beams, s, line, from)]);
        EXPECT_EQ(left.known[at(left.beams, s, line, frame)],
                  us.known[at(us.beams, s, line, from)]);
      }
    }
}

}  // namespace
}  // namespace usct::test
