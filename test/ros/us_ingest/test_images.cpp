#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <us_ct_registration/Acquisition.h>
#include <us_ct_registration/StatusCode.h>
#include <us_ct_registration/Sweep.h>

#include <algorithm>
#include <cmath>

#include "core/ultrasound/lagging_sweep.h"
#include "inbox.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "ros/tf_source.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;
using Eigen::Isometry3d;
using testing::AllOf;
using testing::HasSubstr;

// As config/images/generic_convex.yaml has it.
constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr double kPixelMm = 0.3;
const Eigen::Vector2d kOriginPx(320.0, -160.0);

constexpr double kInterval_s = 0.05;

/// The probe t seconds after the start of a sweep; unsteady, between 2 and 18 mm/s.
Isometry3d pose(double t) {
  return Isometry3d(Eigen::Translation3d(100.0, -40.0, test::unsteady_mm(t)) *
                    Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()));
}

/// The phantom's texture in the plane of the image, in blocks of 8 x 8 pixels, since fewer take
/// less time.
std::vector<std::uint8_t> seen_at(const Isometry3d& T_base_array) {
  static const test::Texture texture(11);
  constexpr int kBlock = 8;
  std::vector<std::uint8_t> pixels(std::size_t{kWidth} * kHeight);
  for (int row = 0; row < kHeight; row += kBlock)
    for (int column = 0; column < kWidth; column += kBlock) {
      const Eigen::Vector2d p_mm = kPixelMm * (Eigen::Vector2d(column, row) - kOriginPx);
      const double grey = texture.at(T_base_array * Eigen::Vector3d(p_mm.x(), p_mm.y(), 0.0));
      const auto value = static_cast<std::uint8_t>(std::clamp(grey, 0.0, 255.0));
      for (int below = 0; below < kBlock; ++below)
        std::fill_n(pixels.begin() + (row + below) * kWidth + column, kBlock, value);
    }
  return pixels;
}

/// A frame grabber and a tracked probe, in front of the node in a namespace.
class LiveImages : public testing::Test {
 protected:
  explicit LiveImages(const std::string& space = "images_by_service")
      : space_(space),
        frame_(std::string("us_array")),
        volumes_(node_, space_ + "/us/volume"),
        announced_(node_, space_ + "/us/announced"),
        diagnostics_(node_, "/diagnostics"),
        images_(node_.advertise<sensor_msgs::Image>(space_ + "/us/image", 1000)),
        tf_(node_, {"/" + space + "/us_ingest"}),
        start_(node_.serviceClient<msg::Sweep>(space_ + "/us/start_sweep")),
        end_(node_.serviceClient<msg::Sweep>(space_ + "/us/end_sweep")) {
    EXPECT_TRUE(eventually([&] { return images_.getNumSubscribers() == 1; }));
    EXPECT_TRUE(volumes_.wait_for_publisher());
  }

  /// The time of the sweep's start, for a sweep of so many seconds that has just ended.
  ::ros::Time start_of(double duration_s) const {
    return ::ros::Time::now() - ::ros::Duration(duration_s + 0.5);
  }

  /// A time since the start of a sweep, s.
  struct Silence {
    double begin_s = 0.0;
    double end_s = 0.0;
  };
  /// tf from 2 s before the sweep to its end, as `shown` moves: at 100 Hz, except in the silence.
  template <typename Pose>
  void move_probe(const ::ros::Time& start, double duration_s, const Pose& shown,
                  const Silence& silence = {}) {
    tf2_msgs::TFMessage message;
    for (int i = -200; i <= std::lround(100.0 * duration_s) + 40; ++i) {
      if (0.01 * i > silence.begin_s && 0.01 * i < silence.end_s) continue;
      geometry_msgs::TransformStamped T;
      T.header.stamp = start + ::ros::Duration(0.01 * i);
      T.header.frame_id = "base";
      T.child_frame_id = frame_;
      T.transform = to_message(shown(0.01 * i));
      message.transforms.push_back(T);
    }
    tf_.publish(message);
  }

  sensor_msgs::Image image(const ::ros::Time& stamp, std::vector<std::uint8_t> pixels) const {
    sensor_msgs::Image image;
    image.header.stamp = stamp;
    image.header.frame_id = frame_;
    image.encoding = "mono8";
    image.width = image.step = kWidth;
    image.height = kHeight;
    image.data = std::move(pixels);
    return image;
  }
  void send(const sensor_msgs::Image& image) {
    images_.publish(image);
    ::ros::WallDuration(0.005).sleep();  // much faster than a grabber, but not than the node
  }

  static Code call(::ros::ServiceClient& service) {
    msg::Sweep call;
    EXPECT_TRUE(service.waitForExistence(kLimit));
    EXPECT_TRUE(service.call(call));
    return call.response.status;
  }
  /// Starts a sweep once `first` has arrived.
  void start_with(const sensor_msgs::Image& first) {
    Code answer;
    EXPECT_TRUE(eventually([&] {
      images_.publish(first);
      answer = call(start_);
      return answer.code == Code::OK;
    })) << answer.message;
  }
  Code refusal_to_start_with(const sensor_msgs::Image& first, std::uint8_t code) {
    Code answer;
    EXPECT_TRUE(eventually([&] {
      images_.publish(first);
      answer = call(start_);
      return answer.code == code;
    })) << answer.message;
    return answer;
  }

  ::ros::NodeHandle node_;
  std::string space_;
  std::string frame_;
  Inbox<msg::PreScanVolume> volumes_;
  Inbox<msg::Acquisition> announced_;
  Inbox<diagnostic_msgs::DiagnosticArray> diagnostics_;
  ::ros::Publisher images_;
  TfSource tf_;
  ::ros::ServiceClient start_;
  ::ros::ServiceClient end_;
};

double worst_mm(const msg::PreScanVolume& volume, const ::ros::Time& start, double lag_error_s) {
  double worst = 0.0;
  for (std::size_t i = 0; i < volume.frame_poses.size(); ++i) {
    const double t = (volume.frame_stamps[i] - start).toSec() + lag_error_s;
    const Isometry3d found = from_message_mm(volume.frame_poses[i], "pose");
    worst = std::max(worst, (found.translation() - pose(t).translation()).norm());
  }
  return worst;
}

TEST_F(LiveImages, ASweepGetsItsPosesCorrectedByTheLagOfItsImagesAndLosesItsDuplicates) {
  constexpr double kLag_s = 0.3;
  constexpr double kDuration_s = 8.0;
  constexpr int kImages = 160;
  const ::ros::Time start = start_of(kDuration_s);
  move_probe(start, kDuration_s, pose);
  // Should this image arrive once more after the start, it has the stamp of the first one.
  start_with(image(start, seen_at(pose(-kLag_s))));
  std::vector<std::uint8_t> pixels;
  for (int i = 0; i < kImages; ++i) {
    const double t = kInterval_s * i;
    if (i % 7 != 1) pixels = seen_at(pose(t - kLag_s));
    send(image(start + ::ros::Duration(t), pixels));
  }
  const std::size_t before = volumes_.all().size();
  // Longer than a sweep may pause: the operator should look whether it was cut short.
  ::ros::WallDuration(1.3).sleep();
  msg::Sweep ended;
  ASSERT_TRUE(end_.call(ended));
  const Code answer = ended.response.status;
  ASSERT_EQ(answer.code, Code::OK) << answer.message;
  EXPECT_THAT(answer.message, HasSubstr("did the images stop before the probe did?"));
  std::printf("%s\n", answer.message.c_str());
  EXPECT_THAT(answer.message, AllOf(HasSubstr("137 images"), HasSubstr("23 repeated image"),
                                    HasSubstr("lag 0."), HasSubstr("estimated from it")));
  ASSERT_TRUE(volumes_.wait(before + 1));
  const msg::PreScanVolume volume = *volumes_.all().back();
  EXPECT_EQ(volume.header.frame_id, "base");
  EXPECT_EQ(volume.header.stamp, volume.frame_stamps.back());
  EXPECT_EQ(volume.header.stamp, ended.response.us_stamp);
  EXPECT_TRUE(eventually([&] {
    const auto announced = announced_.all();
    return announced.size() >= 2 && announced.end()[-2]->state == msg::Acquisition::RECORDING &&
           announced.end()[-2]->header.stamp == start &&
           announced.back()->state == msg::Acquisition::RECORDED &&
           announced.back()->header.stamp == volume.header.stamp;
  }));
  ASSERT_EQ(volume.frames, 137U);
  // Stamps are those of the images minus the estimated lag.
  const double lag_s = (start - volume.frame_stamps.front()).toSec();
  EXPECT_NEAR(lag_s, kLag_s, 0.03);
  // The poses are those at these stamps, and so those that were seen, as far as the lag is right.
  EXPECT_LT(worst_mm(volume, start, 0.0), 0.02);
  EXPECT_LT(worst_mm(volume, start, lag_s - kLag_s), 18.0 * 0.03);
  // Samples are those of the images: line 64 of 128 is 0.25 degrees from the axis, sample 100 at
  // 110 mm.
  const std::vector<std::uint8_t> first = seen_at(pose(-kLag_s));
  const double angle = 0.25 * M_PI / 180.0;
  const long column = std::lround(kOriginPx.x() + 110.0 * std::sin(angle) / kPixelMm);
  const long row = std::lround(kOriginPx.y() + 110.0 * std::cos(angle) / kPixelMm);
  EXPECT_NEAR(volume.data[64 * 240 + 100], first[static_cast<std::size_t>(row * kWidth + column)],
              1.0);
  EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, diagnostic_msgs::DiagnosticStatus::OK,
                                   "published"));
}

TEST_F(LiveImages, ImagesThatStillWaitWhenASweepEndsBelongToIt) {
  const ::ros::Time start = start_of(4.0);
  move_probe(start, 4.0, pose);
  std::vector<sensor_msgs::ImagePtr> images;
  for (int i = 0; i < 80; ++i)
    images.push_back(boost::make_shared<sensor_msgs::Image>(
        image(start + ::ros::Duration(kInterval_s * i), seen_at(pose(kInterval_s * i)))));
  // On a busy machine a pause on their way may end a sweep early, but not each time.
  Code answer;
  EXPECT_TRUE(eventually([&] {
    start_with(*images.front());
    for (const sensor_msgs::ImagePtr& image : images) images_.publish(image);
    answer = call(end_);
    return answer.message.find("80 images") != std::string::npos;
  })) << answer.message;
}

TEST_F(LiveImages, BadImagesAreRefusedWithTheReason) {
  const ::ros::Time start = start_of(1.0);
  move_probe(start, 1.0, pose);
  const sensor_msgs::Image good = image(start, seen_at(pose(0.0)));
  sensor_msgs::Image bad = good;
  bad.encoding = "bayer_grbg8";
  EXPECT_THAT(refusal_to_start_with(bad, Code::INVALID_MESSAGE).message,
              AllOf(HasSubstr("us/image"), HasSubstr("'bayer_grbg8'"), HasSubstr("rgb8")));
  bad = good;
  bad.height = 479;
  bad.data.resize(std::size_t{kWidth} * 479);
  refusal_to_start_with(good, Code::OK);
  EXPECT_THAT(refusal_to_start_with(bad, Code::INVALID_MESSAGE).message,
              AllOf(HasSubstr("640 x 479"), HasSubstr("640 x 480")));
  refusal_to_start_with(good, Code::OK);
  for (const std::uint32_t seconds : {4294967200U, 4294967295U}) {
    bad = good;
    bad.header.stamp = ::ros::Time(seconds, 0);
    EXPECT_THAT(refusal_to_start_with(bad, Code::INVALID_MESSAGE).message,
                HasSubstr("ahead of this node's clock"));
    refusal_to_start_with(good, Code::OK);
  }
  bad = good;
  bad.header.stamp = ::ros::Time();
  EXPECT_THAT(refusal_to_start_with(bad, Code::INVALID_MESSAGE).message, HasSubstr("stamp"));
  bad.header.stamp = start - ::ros::Duration(100.0);
  EXPECT_THAT(refusal_to_start_with(bad, Code::TF_UNAVAILABLE).message,
              AllOf(HasSubstr("no pose"), HasSubstr("past")));
}

TEST_F(LiveImages, ImagesThatNeverArriveAreNamed) {
  const ::ros::Time start = start_of(4.0);
  move_probe(start, 4.0, pose);
  start_with(image(start, seen_at(pose(0.0))));
  // 0.8 s without images, in which the probe moves by about 8 mm.
  for (int i = 0; i < 80; ++i)
    if (i < 30 || i >= 45)
      send(image(start + ::ros::Duration(kInterval_s * i), seen_at(pose(kInterval_s * i))));
  ::ros::WallDuration(0.2).sleep();
  const Code answer = call(end_);
  ASSERT_EQ(answer.code, Code::OK) << answer.message;
  EXPECT_THAT(answer.message, HasSubstr("no image with a pose shows"));
  EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, diagnostic_msgs::DiagnosticStatus::WARN,
                                   "no image with a pose shows"));
}

TEST_F(LiveImages, SweepsThatCannotBeUsedAreRefusedWithTheReason) {
  EXPECT_TRUE(eventually([&] {  // of the test before
    return call(end_).code == Code::NOT_RUNNING;
  }));
  const ::ros::Time start = start_of(2.0);
  move_probe(start, 2.0, pose);
  const std::vector<std::uint8_t> frozen = seen_at(pose(0.0));
  start_with(image(start, frozen));
  for (int i = 0; i < 40; ++i) send(image(start + ::ros::Duration(kInterval_s * i), frozen));
  ::ros::WallDuration(0.2).sleep();
  EXPECT_THAT(call(end_).message, AllOf(HasSubstr("all the same"), HasSubstr("frozen")));
  EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, diagnostic_msgs::DiagnosticStatus::WARN,
                                   "all the same"));

  start_with(image(start, frozen));
  send(image(start + ::ros::Duration(1.0), seen_at(pose(1.0))));
  send(image(start + ::ros::Duration(0.5), seen_at(pose(0.5))));
  Code answer;
  EXPECT_TRUE(eventually([&] {
    answer = call(end_);
    return answer.code == Code::NOT_RUNNING;
  }));
  EXPECT_THAT(answer.message, AllOf(HasSubstr("refused"), HasSubstr("0.5"), HasSubstr("before")));
  EXPECT_THAT(call(end_).code, Code::NOT_RUNNING);
}

class LiveImagesByPause : public LiveImages {
 protected:
  LiveImagesByPause() : LiveImages("images_by_pause") {}
};

TEST_F(LiveImagesByPause, AreOneSweepEachBetweenTwoPauses) {
  EXPECT_FALSE(start_.exists());
  for (std::size_t sweep = 1; sweep <= 2; ++sweep) {
    frame_ = "probe_" + std::to_string(sweep);  // the images name it
    const ::ros::Time start = start_of(2.0);
    move_probe(start, 2.0, pose);
    for (int i = 0; i < 40; ++i) {
      const double t = kInterval_s * i;
      send(image(start + ::ros::Duration(t), seen_at(pose(t))));
    }
    ASSERT_TRUE(volumes_.wait(sweep));
    EXPECT_EQ(volumes_.all()[sweep - 1]->frames, 40U);
    EXPECT_LT(worst_mm(*volumes_.all()[sweep - 1], start, 0.0), 0.02);
  }
  EXPECT_EQ(volumes_.all().size(), 2U);
}

TEST_F(LiveImagesByPause, APauseOfTheStampsAloneEndsASweep) {
  frame_ = "probe_of_a_fast_replay";
  const std::size_t before = volumes_.all().size();
  const ::ros::Time start = start_of(5.0);
  move_probe(start, 5.0, pose);
  for (const double begin_s : {0.0, 3.5})
    for (int i = 0; i < 30; ++i) {
      const double t = begin_s + kInterval_s * i;
      send(image(start + ::ros::Duration(t), seen_at(pose(t))));
    }
  ASSERT_TRUE(volumes_.wait(before + 2));
  for (const std::size_t sweep : {before, before + 1})
    EXPECT_EQ(volumes_.all()[sweep]->frames, 30U);
}

TEST_F(LiveImagesByPause, WhatIsLeftOfARefusedSweepIsNoSweep) {
  frame_ = "probe_with_a_clock_that_steps";
  const std::size_t before = volumes_.all().size();
  const ::ros::Time start = start_of(5.0);
  move_probe(start, 5.0, pose);
  for (int i = 0; i < 60; ++i) {
    const double t = kInterval_s * i - (i < 20 ? 0.0 : 0.3);
    send(image(start + ::ros::Duration(t), seen_at(pose(t))));
  }
  EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, diagnostic_msgs::DiagnosticStatus::WARN,
                                   "before that of the image before"));
  ::ros::WallDuration(1.5).sleep();
  EXPECT_EQ(volumes_.all().size(), before);
  for (int i = 60; i < 90; ++i) {
    const double t = kInterval_s * i;
    send(image(start + ::ros::Duration(t), seen_at(pose(t))));
  }
  ASSERT_TRUE(volumes_.wait(before + 1));
  EXPECT_EQ(volumes_.all().back()->frames, 30U);
}

/// tf2 itself would give poses on a straight line there.
TEST_F(LiveImagesByPause, HaveNoPosesWhileTfWasSilent) {
  frame_ = "probe_that_was_lost";
  const ::ros::Time start = start_of(2.0);
  move_probe(start, 2.0, pose, {0.5, 1.5});
  for (int i = 0; i < 40; ++i) {
    const double t = kInterval_s * i;
    send(image(start + ::ros::Duration(t), seen_at(pose(t))));
  }
  EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, diagnostic_msgs::DiagnosticStatus::WARN,
                                   "max_tf_gap"));
}

}  // namespace
}  // namespace usct::ros_interface
