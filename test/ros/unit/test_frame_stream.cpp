#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

#include "ros/bags/frame_stream.h"
#include "ros/conversions/frames.h"
#include "ros/conversions/ultrasound.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

/// 3 frames x 2 lines x 2 samples, which hold 0, 1, 2...
msg::PreScanVolume volume_of(const ScanGeometry& geometry) {
  PreScanVolume volume;
  volume.geometry = geometry;
  for (int i = 0; i < 12; ++i) volume.voxels.push_back(static_cast<std::uint8_t>(i));
  std_msgs::Header header;
  header.frame_id = "us";
  header.stamp = ::ros::Time(100);
  return to_message(volume, header);
}

ScanGeometry motorised_geometry() {
  return {{2, 3.0, 0.4},
          CurvilinearArray{40.0, {-0.1, 0.1}},
          MotorSweep{27.25, {0.2, 0.0, -0.3}, -0.01}};
}

ScanGeometry tracked() {
  TrackedSweep sweep;
  for (int i = 0; i < 3; ++i)
    sweep.T_us_frame.emplace_back(Eigen::Translation3d(i, 2.0 * i, 0.0) *
                                  Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitX()));
  sweep.frame_times_s = {0.0, 0.5, 1.25};
  return {{2, 3.0, 0.4}, LinearArray{{-1.0, 1.0}}, sweep};
}

void expect_valid(const msg::PreScanFrame& frame) {
  from_message(boost::make_shared<const msg::PreScanFrame>(frame))->validate(0.0);
}

TEST(FramesOf, MotorisedFramesHaveTheirAnglesAndEndAtTheStamp) {
  FrameStream stream;
  stream.sweep = 7;
  stream.frame_period = ::ros::Duration(0.25);
  const auto frames = frames_of(volume_of(motorised_geometry()), stream);
  ASSERT_EQ(frames.size(), 3u);
  for (unsigned i = 0; i < 3; ++i) {
    expect_valid(frames[i]);
    EXPECT_EQ(frames[i].sweep, 7u);
    EXPECT_EQ(frames[i].index, i);
    EXPECT_EQ(frames[i].frames_in_sweep, 3u);
    EXPECT_EQ(frames[i].header.frame_id, "us");
    EXPECT_EQ(frames[i].motor_travel, -0.01);
  }
  EXPECT_EQ(frames[1].motor_angle, 0.0);
  EXPECT_EQ(frames[2].motor_angle, -0.3);
  EXPECT_EQ(frames[0].header.stamp, ::ros::Time(99, 500000000));
  EXPECT_EQ(frames[2].header.stamp, ::ros::Time(100));
  EXPECT_THAT(frames[1].data, testing::ElementsAre(4, 5, 6, 7));
}

TEST(FramesOf, TrackedFramesHaveTheirPosesAndStamps) {
  const msg::PreScanVolume volume = volume_of(tracked());
  const auto frames = frames_of(volume, {});
  ASSERT_EQ(frames.size(), 3u);
  for (unsigned i = 0; i < 3; ++i) {
    expect_valid(frames[i]);
    EXPECT_EQ(frames[i].header.frame_id, "us_array");
    EXPECT_EQ(frames[i].pose_frame_id, "us");
    EXPECT_EQ(frames[i].pose, volume.frame_poses[i]);
    EXPECT_EQ(frames[i].header.stamp, volume.frame_stamps[i]);
  }
  EXPECT_EQ(frames[1].header.stamp, ::ros::Time(99, 250000000));
}

TEST(FramesOf, RefusesDamagedVolumesAndFramesBeforeTheEpoch) {
  msg::PreScanVolume volume = volume_of(motorised_geometry());
  volume.header.stamp = ::ros::Time(0, 1000);
  EXPECT_THROW(frames_of(volume, {}), InputError);
  volume = volume_of(motorised_geometry());
  volume.data[5] ^= 1;
  EXPECT_THROW(frames_of(volume, {}), InputError);
}

}  // namespace
}  // namespace usct::ros_interface
