#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include "bag_sweeps.h"
#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "ros/conversions/poses.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/rendering/picture.h"

namespace usct::ros_interface {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using test::TemporaryFolder;

constexpr int kWidth = 40;
constexpr int kHeight = 30;

/// A video of two frames of one colour each.
EndoscopeVideo video_in(const std::filesystem::path& folder) {
  EndoscopeVideo video;
  video.folder = folder;
  video.camera = {kWidth, kHeight, 50.0, 51.0, 20.0, 14.0, {-0.2, 0.05, 0.001, -0.002, 0.01}};
  video.baseline_mm = 5.0;
  for (int i = 0; i < 2; ++i) {
    for (const char* side : {"left", "right"})
      for (const char* kind : {"", "_tumour"}) {
        Picture picture(kWidth, kHeight);
        std::fill(picture.pixels.begin(), picture.pixels.end(), 10 * (i + 1));
        write_png(picture, folder / formatted("%s%s_%04d.png", side, kind, i));
      }
    video.frames.push_back({0.5 * i, pose(0.3 + 0.2 * i, {20.0, -30.0 * i, 90.0})});
  }
  return video;
}

BagOptions options() {
  BagOptions options = options_at(100.0);
  options.endoscope_delay_s = 7.0;
  return options;
}

TEST(EndoscopeBag, TfLeadsFromTheCamerasToTheCtAsTheTruthSays) {
  const TemporaryFolder folder;
  const EndoscopeVideo video = video_in(folder.path());
  const Isometry3d T_fixed_us = pose(0.7, {100.0, 200.0, -50.0});
  const Isometry3d T_us_ct = pose(-0.4, {10.0, 3.0, 40.0});
  const std::filesystem::path path = folder.path() / "a.bag";
  write_acquisition_bag({{motorised(), T_fixed_us, T_us_ct}}, {}, options(), path, video);

  // The sweep of 4 frames at 4 Hz ends 0.75 s after it began.
  const ::ros::Time first(107.75);
  const rosbag::Bag bag(path.string());
  tf2::BufferCore tf{::ros::Duration(1000.0)};
  for (const auto& message :
       rosbag::View(bag, rosbag::TopicQuery(std::vector<std::string>{"/tf", "/tf_static"}))) {
    const tf2_msgs::TFMessage::ConstPtr transforms = message.instantiate<tf2_msgs::TFMessage>();
    for (const auto& transform : transforms->transforms)
      tf.setTransform(transform, "bag", message.getTopic() == "/tf_static");
  }
  for (std::size_t i = 0; i < video.frames.size(); ++i) {
    const ::ros::Time stamp = first + ::ros::Duration(video.frames[i].time_s);
    const auto T_fixed = [&](const char* frame) {
      return from_message_mm(tf.lookupTransform("patient", frame, stamp).transform, "tf");
    };
    const Isometry3d T_fixed_left = T_fixed_us * T_us_ct * video.frames[i].T_ct_left;
    EXPECT_TRUE(T_fixed("endoscope_left_optical").isApprox(T_fixed_left, 1e-9));
    const Vector3d right_in_left =
        T_fixed_left.inverse() * T_fixed("endoscope_right_optical").translation();
    EXPECT_LT((right_in_left - Vector3d(video.baseline_mm, 0.0, 0.0)).norm(), 1e-9);
  }
}

TEST(EndoscopeBag, ImagesHaveCameraInfoAndTheTruthAtTheirStamps) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.bag";
  const Isometry3d T = Isometry3d::Identity();
  write_acquisition_bag({{motorised(), T, T}}, {}, options(), path, video_in(folder.path()));
  const rosbag::Bag bag(path.string());
  for (const std::string side : {"left", "right"}) {
    std::vector<sensor_msgs::Image> images;
    std::vector<sensor_msgs::Image> masks;
    std::vector<sensor_msgs::CameraInfo> infos;
    for (const auto& message : rosbag::View(bag)) {
      const std::string& topic = message.getTopic();
      if (topic == "/endoscope/" + side + "/image_raw")
        images.push_back(*message.instantiate<sensor_msgs::Image>());
      if (topic == "/truth/endoscope/" + side + "/tumour")
        masks.push_back(*message.instantiate<sensor_msgs::Image>());
      if (topic == "/endoscope/" + side + "/camera_info")
        infos.push_back(*message.instantiate<sensor_msgs::CameraInfo>());
    }
    ASSERT_EQ(images.size(), 2U);
    ASSERT_EQ(masks.size(), 2U);
    ASSERT_EQ(infos.size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) {
      const auto grey = static_cast<std::uint8_t>(10 * (i + 1));
      EXPECT_EQ(images[i].encoding, "rgb8");
      EXPECT_EQ(images[i].data, std::vector<std::uint8_t>(3 * kWidth * kHeight, grey));
      EXPECT_EQ(masks[i].data, std::vector<std::uint8_t>(kWidth * kHeight, grey));
      EXPECT_EQ(images[i].header.stamp, ::ros::Time(107.75 + 0.5 * static_cast<double>(i)));
      EXPECT_EQ(infos[i].header.stamp, images[i].header.stamp);
      EXPECT_EQ(masks[i].header.stamp, images[i].header.stamp);
      EXPECT_EQ(infos[i].header.frame_id, "endoscope_" + side + "_optical");
      EXPECT_EQ(infos[i].D, (std::vector<double>{-0.2, 0.05, 0.001, -0.002, 0.01}));
      EXPECT_EQ(infos[i].K[4], 51.0);
      // REP 104: of the right camera Tx = -fx * baseline, in metres.
      EXPECT_DOUBLE_EQ(infos[i].P[3], side == "right" ? -50.0 * 0.005 : 0.0);
    }
  }
}

TEST(EndoscopeBag, NothingIsWrittenWithoutPoseTruthOrImages) {
  const TemporaryFolder folder;
  const EndoscopeVideo video = video_in(folder.path());
  const std::filesystem::path path = folder.path() / "a.bag";
  const Isometry3d T = Isometry3d::Identity();
  const auto write = [&](const BagAcquisition& acquisition) {
    write_acquisition_bag({acquisition}, {}, options(), path, video);
  };
  test::expect_input_error([&] { write({motorised(), T, {}}); }, {"endoscope", "truth"});
  test::expect_input_error([&] { write({motorised(), {}, T}); }, {"endoscope", "pose"});
  write_png(Picture(kWidth, 2 * kHeight), folder.path() / "right_0001.png");
  test::expect_input_error([&] { write({motorised(), T, T}); }, {"right_0001.png", "40 x 60"});
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace usct::ros_interface
