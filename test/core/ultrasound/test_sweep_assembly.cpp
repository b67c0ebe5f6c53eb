#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "streamed_sweeps.h"

namespace usct::test {
namespace {

using testing::HasSubstr;

TEST(SweepAssembler, VolumesComeBackBitByBitInEitherDirection) {
  Stream stream;
  stream.send(frames_of(motorised(6), 100.0, 3));
  stream.send(frames_of(motorised(6, -1.0), 102.0, 4));
  stream.send(frames_of(tracked(5), 104.0, 5));
  ASSERT_EQ(stream.ended.size(), 3u);
  expect_equal(stream.ended[0], motorised(6));
  expect_equal(stream.ended[1], motorised(6, -1.0));
  expect_equal(stream.ended[2], tracked(5));
  EXPECT_EQ(stream.ended[0].assembled->us_frame_id, "us");
  EXPECT_EQ(stream.ended[2].assembled->us_frame_id, "us");
  EXPECT_EQ(stream.ended[0].assembled->stamps_ns.size(), 6u);
  EXPECT_EQ(stream.ended[0].assembled->stamps_ns.back(), 100 * kSecond);
  EXPECT_TRUE(stream.assembler.dropped().empty());
}

TEST(SweepAssembler, ASweepOfUnknownLengthEndsWithTheNextOrAPause) {
  Stream stream;
  for (std::uint32_t sweep : {0u, 1u})
    for (StreamedFrame frame : frames_of(motorised(6), 100.0 + sweep, sweep)) {
      frame.frames_in_sweep = 0;
      stream.send(frame);
    }
  ASSERT_EQ(stream.ended.size(), 1u);
  stream.pass(0.9);
  EXPECT_EQ(stream.ended.size(), 1u);
  stream.pass(0.2);
  ASSERT_EQ(stream.ended.size(), 2u);
  expect_equal(stream.ended[1], motorised(6));
}

/// A bag that is played again has the same frames at the same times.
TEST(SweepAssembler, TellsASweepFromTheSameOneBefore) {
  AssemblyOptions options;
  options.image_lag_s = 0.5;
  Stream stream(options);
  EXPECT_FALSE(stream.assembler.recording());
  Frames frames = frames_of(motorised(6), 100.0);
  frames.pop_back();
  stream.send(frames);
  ASSERT_TRUE(stream.assembler.recording());
  const SweepAssembler::OpenSweep first = *stream.assembler.recording();
  EXPECT_EQ(first.since_ns, frames.front().stamp_ns - kSecond / 2);
  stream.assembler.add(std::make_shared<StreamedFrame>(frames.front()), 0);  // time ran back
  ASSERT_TRUE(stream.assembler.recording());
  EXPECT_EQ(stream.assembler.recording()->since_ns, first.since_ns);
  EXPECT_NE(stream.assembler.recording()->number, first.number);
}

TEST(SweepAssembler, FramesOutOfOrderAreSortedAndSecondOnesDropped) {
  Stream stream;
  Frames frames = frames_of(motorised(6), 100.0);
  std::swap(frames[1], frames[4]);
  frames.insert(frames.begin() + 3, frames[2]);
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  expect_equal(stream.ended[0], motorised(6));
  EXPECT_EQ(stream.dropped("same index"), 1u);
}

TEST(SweepAssembler, FewMissingFramesAreLeftOutMoreRefuse) {
  AssemblyOptions options;
  options.max_missing = 0.2;
  Stream stream(options);
  Frames frames = frames_of(motorised(10), 100.0);
  frames.erase(frames.begin() + 3, frames.begin() + 5);
  stream.send(frames);
  stream.pass(1.1);
  ASSERT_EQ(stream.ended.size(), 1u);
  ASSERT_TRUE(stream.ended[0].assembled) << stream.ended[0].message;
  EXPECT_EQ(frame_count(stream.ended[0]), 8);
  EXPECT_EQ(stream.ended[0].message, "2 missing");

  for (StreamedFrame& frame : frames) frame.sweep = 1;
  frames.pop_back();
  stream.send(frames);
  stream.pass(1.1);
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_FALSE(stream.ended[1].assembled);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("3 of 10 frames are missing"));
  EXPECT_EQ(stream.dropped("missing"), 5u);
}

TEST(SweepAssembler, LateFramesAreDroppedAndASenderMayStartAnew) {
  Stream stream;
  const Frames frames = frames_of(motorised(6), 100.0);
  stream.send(frames);
  stream.send(frames[4]);
  const Frames next = frames_of(motorised(6), 103.0, 1);
  stream.send(next[0]);
  stream.send(frames[5]);  // does not end the sweep that has begun
  EXPECT_EQ(stream.dropped("late"), 2u);
  stream.send({next.begin() + 1, next.end()});
  ASSERT_EQ(stream.ended.size(), 2u);
  expect_equal(stream.ended[1], motorised(6));

  // The same bag is sent once more, then a sender that died within a sweep counts from 0 again.
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 3u);
  stream.send({next.begin(), next.begin() + 3});
  stream.send(frames_of(motorised(6), 110.0, 1));
  ASSERT_EQ(stream.ended.size(), 5u);
  EXPECT_THAT(stream.ended[3].message, HasSubstr("3 of 6 frames are missing"));
  expect_equal(stream.ended[4], motorised(6));
}

TEST(SweepAssembler, WhatChangesWithinASweepRefusesIt) {
  const auto refusal = [](const std::function<void(StreamedFrame&)>& change) {
    Stream stream;
    Frames frames = frames_of(motorised(6), 100.0);
    change(frames[4]);
    stream.send(frames);
    EXPECT_EQ(stream.ended.size(), 1u);  // the sweep's other frames do not begin a new one
    EXPECT_FALSE(stream.ended[0].assembled);
    return stream.ended[0].message;
  };
  EXPECT_THAT(
      refusal([](auto& f) { std::get<CurvilinearArray>(f.array).line_angles_rad[1] += 1e-9; }),
      HasSubstr("geometry of the probe changes at frame 4"));
  EXPECT_THAT(refusal([](auto& f) {
                f.axial.samples = 2;
                set_image(f, std::vector<std::uint8_t>(6, 1));
              }),
              HasSubstr("size changes at frame 4 from 4 x 3 to 2 x 3"));
  EXPECT_THAT(refusal([](auto& f) { f.frames_in_sweep = 7; }), HasSubstr("'frames_in_sweep'"));
  EXPECT_THAT(refusal([](auto& f) { f.frame_id = "other"; }), HasSubstr("frame_id"));
  EXPECT_THAT(refusal([](auto& f) { f.stamp_ns = kSecond; }), HasSubstr("stamped before"));
}

TEST(SweepAssembler, AbsurdNumbersAreRefusedWithoutMemory) {
  AssemblyOptions options;
  options.max_frames = 50;
  options.max_bytes = 5 * kSamples * kLines;
  Stream stream(options);
  Frames frames = frames_of(motorised(6), 100.0);
  frames[0].frames_in_sweep = 4000000000u;
  stream.send(frames[0]);
  ASSERT_EQ(stream.ended.size(), 1u);
  EXPECT_THAT(stream.ended[0].message, HasSubstr("max_frames is 50"));

  for (StreamedFrame& frame : frames) {
    frame.sweep = 1;
    frame.frames_in_sweep = 0;
  }
  frames[2].index = 4000000000u;
  stream.send({frames.begin(), frames.begin() + 3});
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("max_frames is 50"));

  stream.send(frames_of(motorised(6), 110.0, 2));
  ASSERT_EQ(stream.ended.size(), 3u);
  EXPECT_THAT(stream.ended[2].message, HasSubstr("max_volume_mb"));
}

TEST(SweepAssembler, InvalidFramesAreCountedAndNamed) {
  Stream stream;
  StreamedFrame frame = frames_of(motorised(6), 100.0)[2];
  const auto problem = [&](const std::function<void(StreamedFrame&)>& spoil) {
    StreamedFrame spoilt = frame;
    spoil(spoilt);
    stream.send(spoilt);
    return stream.assembler.last_problem();
  };
  EXPECT_THAT(problem([](auto& f) { set_image(f, std::vector<std::uint8_t>(11, 1)); }),
              HasSubstr("has 11 values"));
  EXPECT_THAT(problem([](auto& f) { f.index = 6; }), HasSubstr("'frames_in_sweep'"));
  EXPECT_THAT(problem([](auto& f) { f.stamp_ns = 0; }), HasSubstr("stamp"));
  EXPECT_THAT(problem([](auto& f) { f.frame_id.clear(); }), HasSubstr("frame_id"));
  EXPECT_THAT(problem([](auto& f) { f.motor->angle_rad = std::nan(""); }),
              HasSubstr("motor_angle"));
  EXPECT_EQ(stream.dropped("invalid"), 5u);
  stream.pass(10.0);
  EXPECT_TRUE(stream.ended.empty());
}

TEST(SweepAssembler, FramesThatCouldNotBeReadAreInvalid) {
  Stream stream;
  EXPECT_TRUE(stream.assembler.add_invalid("'data' has 11 values", 5000 * kSecond).empty());
  EXPECT_EQ(stream.dropped("invalid"), 1u);
  EXPECT_EQ(stream.assembler.received(), 1u);
  EXPECT_EQ(stream.assembler.last_problem(), "'data' has 11 values");
}

TEST(SweepAssembler, ANumberThatIsUsedAgainIsNotLateIfItsFirstFrameIsLost) {
  AssemblyOptions options;
  options.max_missing = 0.2;
  Stream stream(options);
  stream.send(frames_of(motorised(6), 100.0));
  Frames next = frames_of(motorised(6), 110.0);
  next.erase(next.begin());
  stream.send(next);
  stream.pass(1.1);
  EXPECT_EQ(stream.dropped("late"), 0u);
  ASSERT_EQ(stream.ended.size(), 2u);
  ASSERT_TRUE(stream.ended[1].assembled) << stream.ended[1].message;
  EXPECT_EQ(frame_count(stream.ended[1]), 5);
}

TEST(SweepAssembler, ASweepThatGoesOnAfterAPauseOfItsFramesIsRefused) {
  Stream stream;
  Frames frames = frames_of(motorised(40), 100.0);
  for (StreamedFrame& frame : frames) frame.frames_in_sweep = 0;
  stream.send({frames.begin(), frames.begin() + 20});
  stream.pass(1.1);  // the network is held up
  ASSERT_EQ(stream.ended.size(), 1u);
  EXPECT_TRUE(stream.ended[0].assembled);
  // They take longer than a pause, and are no sweep of their own.
  stream.send({frames.begin() + 20, frames.end()});
  stream.pass(1.1);
  EXPECT_EQ(stream.dropped("late"), 20u);
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_FALSE(stream.ended[1].assembled);
  EXPECT_EQ(stream.ended[1].newest_ns, frames[20].stamp_ns);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("sweep 0: frame 20 came after a pause"));
}

TEST(SweepAssembler, TimeThatRunsBackwardsRefusesTheOpenSweep) {
  Stream stream;
  const Frames frames = frames_of(motorised(6), 100.0);
  stream.send({frames.begin(), frames.begin() + 3});
  stream.pass(-100.0);
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_FALSE(stream.ended[0].assembled);
  EXPECT_THAT(stream.ended[0].message, HasSubstr("sweep 0: time ran back"));
  EXPECT_EQ(stream.ended[0].newest_ns, 0);
  expect_equal(stream.ended[1], motorised(6));
}

TEST(SweepAssembler, AClockThatIsCorrectedByLittleLosesNoSweep) {
  Stream stream;
  const Frames frames = frames_of(motorised(6), 100.0);
  stream.send({frames.begin(), frames.begin() + 3});
  stream.pass(-0.15);  // the next frame comes 0.05 s before the one before
  stream.send({frames.begin() + 3, frames.end()});
  ASSERT_EQ(stream.ended.size(), 1u);
  expect_equal(stream.ended[0], motorised(6));
}

}  // namespace
}  // namespace usct::test
