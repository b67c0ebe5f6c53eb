#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

#include "ros/overlay/stamp_pairs.h"

namespace usct::ros_interface {
namespace {

template <typename Message>
boost::shared_ptr<const Message> at(double time_s) {
  auto message = boost::make_shared<Message>();
  message->header.stamp = ::ros::Time(time_s);
  return message;
}
const auto image_at = at<sensor_msgs::Image>;
const auto info_at = at<sensor_msgs::CameraInfo>;

TEST(StampPairs, AreOfOneStampInWhicheverOrderTheyCome) {
  StampPairs pairs(4, 4);
  EXPECT_FALSE(pairs.add(image_at(1.0)));
  EXPECT_FALSE(pairs.add(image_at(1.1)));
  const auto late = pairs.add(info_at(1.0));
  ASSERT_TRUE(late);
  EXPECT_EQ(late->image->header.stamp, ::ros::Time(1.0));
  EXPECT_EQ(late->info->header.stamp, ::ros::Time(1.0));
  EXPECT_TRUE(pairs.add(info_at(1.1)));
  EXPECT_FALSE(pairs.add(info_at(1.2)));
  EXPECT_TRUE(pairs.add(image_at(1.2)));
}

TEST(StampPairs, TheOldestThatWaitsGoesFirst) {
  StampPairs pairs(2, 2);
  for (const double time_s : {1.0, 1.1, 1.2}) pairs.add(image_at(time_s));
  EXPECT_FALSE(pairs.add(info_at(1.0)));
  EXPECT_TRUE(pairs.add(info_at(1.1)));
}

/// An image that is rectified first comes several camera_infos later than its own.
TEST(StampPairs, CameraInfosMayWaitLonger) {
  StampPairs pairs(1, 8);
  for (int i = 0; i < 8; ++i) pairs.add(info_at(1.0 + 0.1 * i));
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(pairs.add(image_at(1.0 + 0.1 * i))) << i;
}

/// A recording is played again while images of its end still wait for their camera_info.
TEST(StampPairs, BeginAnewWhenStampsRunBack) {
  StampPairs pairs(4, 4);
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(pairs.add(image_at(100.0 + 0.1 * i)));
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(pairs.add(image_at(50.0 + 0.1 * i)));
    EXPECT_TRUE(pairs.add(info_at(50.0 + 0.1 * i))) << i;
  }
  // The camera_info of the second time is not that of the image of the first time.
  StampPairs again(4, 4);
  again.add(image_at(100.0));
  again.add(image_at(50.0));
  EXPECT_FALSE(again.add(info_at(100.0)));
}

}  // namespace
}  // namespace usct::ros_interface
