#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "streamed_sweeps.h"

namespace usct::test {
namespace {

using testing::HasSubstr;

TEST(SweepAssembler, RepeatedImagesAreDroppedBlankOnesAreNot) {
  Stream stream;
  Frames frames = frames_of(tracked(8), 100.0);
  frames[3].brightness = frames[2].brightness;
  for (std::size_t i : {5, 6}) set_image(frames[i], std::vector<std::uint8_t>(12, 0));
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  EXPECT_EQ(frame_count(stream.ended[0]), 7);
  EXPECT_EQ(track_of(stream.ended[0]).T_us_frame[3].matrix(), frames[4].pose->T_us_frame.matrix());
  EXPECT_EQ(stream.dropped("repeated image"), 1u);
}

TEST(SweepAssembler, AMotorThatRestsOrTurnsBack) {
  Stream stream;
  Frames frames = frames_of(motorised(8, -1.0), 100.0);
  frames[4].motor->angle_rad = frames[5].motor->angle_rad = frames[3].motor->angle_rad;
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  ASSERT_TRUE(stream.ended[0].assembled) << stream.ended[0].message;
  EXPECT_EQ(frame_count(stream.ended[0]), 6);
  EXPECT_EQ(stream.dropped("motor at rest"), 2u);
  EXPECT_EQ(motor_of(stream.ended[0]).frame_travel_rad, -0.011);

  frames = frames_of(motorised(8), 110.0, 1);
  frames[6].motor->angle_rad = frames[4].motor->angle_rad;
  stream.send(frames);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("turns back at frame 6"));

  frames = frames_of(motorised(8), 120.0, 2);
  frames[6].motor->travel_rad = -frames[6].motor->travel_rad;
  stream.send(frames);
  EXPECT_THAT(stream.ended[2].message, HasSubstr("'motor_travel' changes"));
}

TEST(SweepAssembler, LagShiftsPosesAndStamps) {
  AssemblyOptions options;
  options.image_lag_s = 0.25;
  Stream stream(options);
  stream.send(frames_of(tracked(8), 100.0));
  ASSERT_EQ(stream.ended.size(), 1u);
  // Frames 3 to 7, at the poses of 0.5 to 4.5.
  ASSERT_TRUE(stream.ended[0].assembled) << stream.ended[0].message;
  EXPECT_EQ(frame_count(stream.ended[0]), 5);
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_NEAR(track_of(stream.ended[0]).T_us_frame[i].translation().z(),
                static_cast<double>(i) + 0.5, 1e-6);
  EXPECT_EQ(stream.ended[0].assembled->stamps_ns.back(), 99'750'000'000);
  EXPECT_EQ(stream.dropped("no pose at the stamp minus image_lag"), 3u);

  // A motor has no pose to shift; the volume was acquired the lag before its last stamp.
  stream.send(frames_of(motorised(6), 110.0, 1));
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_EQ(frame_count(stream.ended[1]), 6);
  EXPECT_EQ(stream.ended[1].assembled->stamps_ns.back(), 109'750'000'000);
}

TEST(SweepAssembler, OneImageAllAlongIsRefused) {
  AssemblyOptions options;
  options.image_lag_s = 0.25;
  Stream stream(options);
  Frames frames = frames_of(tracked(8), 100.0);
  for (StreamedFrame& frame : frames) frame.brightness = frames[0].brightness;
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  EXPECT_FALSE(stream.ended[0].assembled);
  EXPECT_THAT(stream.ended[0].message, HasSubstr("no image changes"));
}

TEST(SweepAssembler, PosesThatWereLookedUpCountAndFramesWithoutAreMissing) {
  Stream stream;
  Frames frames = frames_of(tracked(10), 100.0);
  for (StreamedFrame& frame : frames) {
    frame.pose->at_stamp = false;
    frame.pose->us_frame_id = "patient";
  }
  frames[4].pose.reset();
  frames[4].pose_problem = "extrapolation";
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  ASSERT_TRUE(stream.ended[0].assembled) << stream.ended[0].message;
  EXPECT_EQ(stream.ended[0].assembled->us_frame_id, "patient");
  EXPECT_EQ(frame_count(stream.ended[0]), 9);
  EXPECT_EQ(track_of(stream.ended[0]).T_us_frame[4].matrix(), frames[5].pose->T_us_frame.matrix());
  EXPECT_EQ(stream.dropped("without pose"), 1u);
  EXPECT_THAT(stream.assembler.last_problem(), HasSubstr("frame 4: no pose: extrapolation"));

  frames = frames_of(tracked(10), 110.0, 1);
  for (StreamedFrame& frame : frames) {
    frame.pose.reset();
    stream.send(frame);
  }
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("10 of them for want of a pose"));
}

/// Poses that were looked up are already corrected for the lag.
TEST(SweepAssembler, PosesThatWereLookedUpAreNotShifted) {
  AssemblyOptions options;
  options.image_lag_s = 0.25;
  Stream stream(options);
  Frames frames = frames_of(tracked(8), 100.0);
  for (StreamedFrame& frame : frames) frame.pose->at_stamp = false;
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  expect_equal(stream.ended[0], tracked(8));
  EXPECT_EQ(stream.ended[0].assembled->stamps_ns.back(), 99'750'000'000);
}

}  // namespace
}  // namespace usct::test
