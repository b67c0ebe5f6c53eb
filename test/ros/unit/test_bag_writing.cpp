#include <geometry_msgs/TransformStamped.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <std_msgs/String.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>
#include <us_ct_registration/PreScanFrame.h>

#include "bag_sweeps.h"
#include "core/io/temporary_folder.h"
#include "ros/conversions/ct.h"
#include "ros/conversions/poses.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Eigen::Isometry3d;
using test::TemporaryFolder;

constexpr double kToleranceMm = 1e-9;

/// Content of a bag, as a subscriber to all topics would have received it.
struct Heard {
  std::vector<msg::PreScanFrame> frames;
  std::vector<geometry_msgs::TransformStamped> truths;
  std::vector<msg::CtVolume> cts;
  std::vector<std::string> ct_paths;
  std::vector<std::string> latched_topics;
  tf2::BufferCore tf{::ros::Duration(1000.0)};
  unsigned static_transforms = 0;
  ::ros::Time begin;
  ::ros::Time end;

  Isometry3d T_mm(const std::string& target, const std::string& source, double time_s) const {
    return from_message_mm(tf.lookupTransform(target, source, ::ros::Time(time_s)).transform, "tf");
  }
};

void take_transforms(const rosbag::MessageInstance& message, Heard& heard) {
  const bool is_static = message.getTopic() == "/tf_static";
  const tf2_msgs::TFMessage::ConstPtr transforms = message.instantiate<tf2_msgs::TFMessage>();
  for (const auto& transform : transforms->transforms) {
    EXPECT_TRUE(heard.tf.setTransform(transform, "bag", is_static));
    heard.static_transforms += is_static;
    EXPECT_TRUE(is_static || transform.header.stamp == message.getTime());
  }
}

void listen(const std::filesystem::path& path, Heard& heard) {
  const rosbag::Bag bag(path.string());
  rosbag::View view(bag);
  for (const rosbag::ConnectionInfo* connection : view.getConnections())
    if (const auto latching = connection->header->find("latching");
        latching != connection->header->end() && latching->second == "1")
      heard.latched_topics.push_back(connection->topic);
  heard.begin = view.getBeginTime();
  heard.end = view.getEndTime();
  for (const rosbag::MessageInstance& message : view) {
    const std::string& topic = message.getTopic();
    if (topic == "/us/frames")
      heard.frames.push_back(*message.instantiate<msg::PreScanFrame>());
    else if (topic == "/truth/alignment")
      heard.truths.push_back(*message.instantiate<geometry_msgs::TransformStamped>());
    else if (topic == "/ct/volume")
      heard.cts.push_back(*message.instantiate<msg::CtVolume>());
    else if (topic == "/ct/path")
      heard.ct_paths.push_back(message.instantiate<std_msgs::String>()->data);
    else
      take_transforms(message, heard);
  }
}

void write_and_listen(const std::vector<BagAcquisition>& acquisitions, const BagCt& ct,
                      const BagOptions& options, Heard& heard) {
  const TemporaryFolder folder;
  write_acquisition_bag(acquisitions, ct, options, folder.path() / "a.bag");
  listen(folder.path() / "a.bag", heard);
}

TEST(AcquisitionBag, FramesAreStreamedFromTheStartAtTheFrameRate) {
  Heard heard;
  write_and_listen({{motorised(), {}, {}}}, {}, options_at(100.0), heard);
  ASSERT_EQ(heard.frames.size(), 4u);
  const PreScanVolume volume = motorised();
  for (unsigned i = 0; i < 4; ++i) {
    const msg::PreScanFrame& frame = heard.frames[i];
    EXPECT_NEAR(frame.header.stamp.toSec(), 100.0 + 0.25 * i, 1e-6);
    EXPECT_EQ(frame.header.frame_id, "us");
    EXPECT_EQ(frame.index, i);
    EXPECT_EQ(frame.motor_angle, std::get<MotorSweep>(volume.geometry.motion).frame_angles_rad[i]);
    EXPECT_THAT(frame.data, testing::ElementsAreArray(volume.voxels.begin() + 6 * i,
                                                      volume.voxels.begin() + 6 * (i + 1)));
  }
  EXPECT_FALSE(heard.tf._frameExists("us")) << "a pose that nobody gave";
}

TEST(AcquisitionBag, TheRobotHoldsTheProbeDuringTheSweepAndThenTakesItAway) {
  const Isometry3d T_fixed_us = pose(1.1, {100.0, -50.0, 20.0});
  Heard heard;
  write_and_listen({{motorised(), T_fixed_us, {}}}, {}, options_at(100.0), heard);
  for (const double time_s : {100.0, 100.3, 100.75})
    EXPECT_TRUE(heard.T_mm("patient", "us", time_s).isApprox(T_fixed_us, kToleranceMm)) << time_s;
  // The probe is 100 mm back along its axis, and not rotated.
  const Isometry3d away = T_fixed_us.inverse() * heard.T_mm("patient", "us", heard.end.toSec());
  EXPECT_TRUE(away.isApprox(Isometry3d(Eigen::Translation3d(0.0, -100.0, 0.0)), 1e-6));
  const Isometry3d arriving = T_fixed_us.inverse() * heard.T_mm("patient", "us", 97.6);
  EXPECT_NEAR(arriving.translation().y(), -100.0, 1e-6);
  EXPECT_EQ(heard.static_transforms, 0u);
}

TEST(AcquisitionBag, AProbeThatStaysIsStatic) {
  const Isometry3d T_fixed_us = pose(1.1, {100.0, -50.0, 20.0});
  BagOptions options = options_at(100.0);
  options.retract_mm = 0.0;
  Heard heard;
  write_and_listen({{motorised(), T_fixed_us, {}}}, {}, options, heard);
  EXPECT_EQ(heard.static_transforms, 1u);
  EXPECT_TRUE(heard.T_mm("patient", "us", 1.0).isApprox(T_fixed_us, kToleranceMm));
}

TEST(AcquisitionBag, EachSweepHasItsNumberItsPoseAndItsTruth) {
  const Isometry3d first = pose(1.1, {100.0, -50.0, 20.0});
  const Isometry3d second = pose(-0.4, {80.0, 10.0, 0.0});
  const Isometry3d T_us_ct = pose(0.7, {-30.0, 5.0, 900.0});
  BagOptions options = options_at(100.0);
  options.pause_s = 4.0;
  Heard heard;
  write_and_listen({{motorised(), first, T_us_ct}, {motorised(), second, T_us_ct}}, {}, options,
                   heard);
  ASSERT_EQ(heard.frames.size(), 8u);
  EXPECT_EQ(heard.frames[3].sweep, 0u);
  EXPECT_EQ(heard.frames[4].sweep, 1u);
  EXPECT_NEAR(heard.frames[4].header.stamp.toSec(), 104.75, 1e-6);
  EXPECT_TRUE(heard.T_mm("patient", "us", 100.5).isApprox(first, kToleranceMm));
  EXPECT_TRUE(heard.T_mm("patient", "us", 105.0).isApprox(second, kToleranceMm));
  ASSERT_EQ(heard.truths.size(), 2u);
  for (unsigned i = 0; i < 2; ++i) {
    const Isometry3d expected = (i == 0 ? first : second) * T_us_ct;
    EXPECT_EQ(heard.truths[i].header.frame_id, "patient");
    EXPECT_EQ(heard.truths[i].child_frame_id, "ct");
    EXPECT_TRUE(from_message_mm(heard.truths[i].transform, "truth").isApprox(expected, 1e-12));
  }
  EXPECT_THAT(heard.latched_topics, testing::ElementsAre("/truth/alignment"));
}

TEST(AcquisitionBag, PosesOfATrackedSweepAreInTheFramesOrInTf) {
  const Isometry3d T_fixed_us = pose(0.3, {1.0, 2.0, 3.0});
  const PreScanVolume volume = tracked();
  const auto& sweep = std::get<TrackedSweep>(volume.geometry.motion);
  BagOptions options = options_at(100.0);
  Heard in_frames;
  write_and_listen({{volume, T_fixed_us, {}}}, {}, options, in_frames);
  options.poses_in_tf = true;
  Heard in_tf;
  write_and_listen({{volume, T_fixed_us, {}}}, {}, options, in_tf);
  ASSERT_EQ(in_frames.frames.size(), 4u);
  ASSERT_EQ(in_tf.frames.size(), 4u);
  for (unsigned i = 0; i < 4; ++i) {
    const double time_s = 100.0 + sweep.frame_times_s[i];
    EXPECT_NEAR(in_tf.frames[i].header.stamp.toSec(), time_s, 1e-6);
    EXPECT_EQ(in_frames.frames[i].pose_frame_id, "us");
    EXPECT_TRUE(
        from_message_mm(in_frames.frames[i].pose, "frame").isApprox(sweep.T_us_frame[i], 1e-9));
    EXPECT_EQ(in_tf.frames[i].pose_frame_id, "");
    EXPECT_EQ(in_tf.frames[i].header.frame_id, "us_array");
    EXPECT_TRUE(in_tf.T_mm("us", "us_array", time_s).isApprox(sweep.T_us_frame[i], 1e-9));
  }
  // The US frame, to which the poses map, does not move when the array moves away.
  EXPECT_EQ(in_tf.static_transforms, 1u);
  const Isometry3d away =
      sweep.T_us_frame[3].inverse() * in_tf.T_mm("us", "us_array", in_tf.end.toSec());
  EXPECT_NEAR(away.translation().y(), -100.0, 1e-6);
}

TEST(AcquisitionBag, TheCtIsInTheBagOrNamed) {
  BagCt ct;
  ct.volume.emplace();
  ct.volume->grid.size = {2, 2, 2};
  ct.volume->grid.spacing_mm = {1.0, 2.0, 3.0};
  ct.volume->voxels = {-1000, 0, 1, 2, 3, 4, 5, 3000};
  Heard inside;
  write_and_listen({{motorised(), {}, {}}}, ct, options_at(100.0), inside);
  ASSERT_EQ(inside.cts.size(), 1u);
  EXPECT_EQ(from_message(inside.cts[0], "bag").voxels, ct.volume->voxels);
  EXPECT_EQ(inside.cts[0].header.frame_id, "ct");
  // Ultrasound that is older than the CT would be refused.
  EXPECT_LT(inside.cts[0].header.stamp, inside.frames.front().header.stamp);
  EXPECT_EQ(inside.cts[0].header.stamp, inside.begin);
  EXPECT_THAT(inside.latched_topics, testing::ElementsAre("/ct/volume"));
  Heard named;
  write_and_listen({{motorised(), {}, {}}}, {{}, "case/ct.nrrd"}, options_at(100.0), named);
  EXPECT_THAT(named.ct_paths, testing::ElementsAre("case/ct.nrrd"));
  EXPECT_THAT(named.latched_topics, testing::ElementsAre("/ct/path"));
}

TEST(AcquisitionBag, OptionsThatContradictAreRefused) {
  const TemporaryFolder folder;
  const auto write = [&](const std::vector<BagAcquisition>& acquisitions, BagOptions options) {
    write_acquisition_bag(acquisitions, {}, options, folder.path() / "a.bag");
  };
  const Isometry3d T = Isometry3d::Identity();
  BagOptions in_tf = options_at(100.0);
  in_tf.poses_in_tf = true;
  BagOptions short_pause = options_at(100.0);
  short_pause.pause_s = 1.0;
  BagOptions same_frames = options_at(100.0);
  same_frames.fixed_frame = same_frames.us_frame;
  EXPECT_THROW(write({{motorised(), T, {}}}, same_frames), InputError);
  EXPECT_THROW(write({}, options_at(100.0)), InputError);
  EXPECT_THROW(write({{motorised(), {}, {}}, {tracked(), {}, {}}}, options_at(100.0)), InputError);
  EXPECT_THROW(write({{motorised(), T, {}}, {motorised(), {}, {}}}, options_at(100.0)), InputError);
  EXPECT_THROW(write({{motorised(), T, {}}}, in_tf), InputError);
  EXPECT_THROW(write({{motorised(), T, {}}}, short_pause), InputError);
  EXPECT_THROW(write({{motorised(), T, {}}}, options_at(1.0)), InputError);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "nothing must be left behind";
}

}  // namespace
}  // namespace usct::ros_interface
