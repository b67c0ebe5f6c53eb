#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/tf/tf_watch.h"

namespace usct::ros_interface {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const TfWatch::Clock::time_point kStart{std::chrono::hours(1)};

geometry_msgs::TransformStamped transform(const std::string& parent, const std::string& child,
                                          double x = 0.0) {
  geometry_msgs::TransformStamped message;
  message.header.stamp = ::ros::Time(10.0);
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform.translation.x = x;
  message.transform.rotation.w = 1.0;
  return message;
}

TEST(TfWatch, OtherFramesAndOwnTransformsAreNoConflict) {
  TfWatch watch;
  watch.heard(transform("world", "base"), "robot", false, kStart);
  watch.heard(transform("base", "us"), "robot", false, kStart);
  watch.heard(transform("ct", "tumour"), "planner", false, kStart);
  watch.sent(transform("base", "ct"));
  watch.heard(transform("base", "ct"), "tf_publisher", false, kStart);
  EXPECT_EQ(watch.conflict("base", "ct", kStart), "");
}

TEST(TfWatch, AnotherPublisherIsAConflictAlsoWithinTheSameProcess) {
  TfWatch watch;
  watch.sent(transform("base", "ct"));
  watch.heard(transform("base", "ct", 0.1), "manager", false, kStart);
  EXPECT_THAT(
      watch.conflict("base", "ct", kStart),
      AllOf(HasSubstr("node 'manager'"), HasSubstr("'base' -> 'ct'"), HasSubstr("as well")));
}

TEST(TfWatch, TwoOwnFramesMayHaveTheSameStamp) {
  TfWatch watch;
  watch.sent(transform("base", "ct"));
  watch.sent(transform("base", "ct_proposed", 0.1));
  watch.heard(transform("base", "ct"), "tf_publisher", false, kStart);
  watch.heard(transform("base", "ct_proposed", 0.1), "tf_publisher", false, kStart);
  EXPECT_EQ(watch.conflict("base", "ct", kStart), "");
  EXPECT_EQ(watch.conflict("base", "ct_proposed", kStart), "");
}

TEST(TfWatch, OwnTransformsAreKnownHoweverManyThereAre) {
  TfWatch watch;
  geometry_msgs::TransformStamped last;
  for (int i = 0; i < 20'000; ++i) {
    geometry_msgs::TransformStamped next = transform("base", "ct");
    next.header.stamp = ::ros::Time(10.0 + 0.05 * i);
    watch.sent(next);
    // A transform arrives after the next one was sent.
    if (i > 0) watch.heard(last, "tf_publisher", false, kStart);
    last = next;
    ASSERT_EQ(watch.conflict("base", "ct", kStart), "") << i;
  }
}

TEST(TfWatch, ASecondParentIsAConflictAlsoWithALeadingSlash) {
  TfWatch watch;
  watch.heard(transform("/table", "/ct"), "other", false, kStart);
  EXPECT_THAT(
      watch.conflict("base", "ct", kStart),
      AllOf(HasSubstr("node 'other'"), HasSubstr("'table' -> 'ct'"), HasSubstr("one parent")));
}

TEST(TfWatch, ALoopIsAConflictAndLoopsOfOthersEndTheSearch) {
  TfWatch watch;
  watch.heard(transform("ct", "marker"), "a", true, kStart);
  EXPECT_EQ(watch.conflict("base", "ct", kStart), "");
  watch.heard(transform("marker", "base"), "b", false, kStart);
  EXPECT_THAT(watch.conflict("base", "ct", kStart),
              AllOf(HasSubstr("'ct' -> 'marker' -> 'base'"), HasSubstr("loop")));
  TfWatch others;
  others.heard(transform("x", "base"), "a", true, kStart);
  others.heard(transform("base", "x"), "b", true, kStart);
  EXPECT_EQ(others.conflict("base", "ct", kStart), "");
}

TEST(TfWatch, WhatListenersHaveForgottenIsNoConflict) {
  TfWatch watch;
  watch.heard(transform("base", "ct"), "other", false, kStart);
  EXPECT_NE(watch.conflict("base", "ct", kStart + TfWatch::kMemory), "");
  const auto later = kStart + TfWatch::kMemory + std::chrono::milliseconds(1);
  EXPECT_EQ(watch.conflict("base", "ct", later), "");
  watch.heard(transform("base", "ct"), "other", true, kStart);
  EXPECT_NE(watch.conflict("base", "ct", later + std::chrono::hours(9)), "");
}

}  // namespace
}  // namespace usct::ros_interface
