#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tf2/exceptions.h>

#include <cmath>
#include <map>

#include "ros/conversions/poses.h"
#include "ros/node/refusal.h"
#include "ros/tf/fixed_frame.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_wait.h"

namespace usct::ros_interface {
namespace {

using Status = us_ct_registration::StatusCode;
using testing::AllOf;
using testing::HasSubstr;

constexpr double kHistory_s = 60.0;

void know(TfBuffer& tf, double seconds, double x_mm = 0.0, const std::string& child = "us",
          const std::string& parent = "patient", bool is_static = false) {
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = ::ros::Time(seconds);
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform.translation.x = x_mm / kMmPerM;
  transform.transform.rotation.w = 1.0;
  EXPECT_TRUE(tf.set_transform(transform, "test", is_static)) << seconds;
}

/// The transforms of a frame at 10 Hz.
void know_from(TfBuffer& tf, double from_s, double to_s, double x_mm,
               const std::string& child = "us", const std::string& parent = "patient") {
  for (int i = 0; from_s + 0.1 * i <= to_s + 0.01; ++i)
    know(tf, from_s + 0.1 * i, x_mm, child, parent);
}

/// tf until 101 s and from 105 s on, with the frame elsewhere.
void interrupt(TfBuffer& tf, const std::string& child = "us",
               const std::string& parent = "patient") {
  know_from(tf, 100.0, 101.0, 0.0, child, parent);
  know_from(tf, 105.0, 106.0, 40.0, child, parent);
}

bool is_known(const TfBuffer& tf, double seconds) {
  return tf.can_transform("patient", "us", ::ros::Time(seconds));
}

TEST(TfBuffer, APoseWithinAGapIsNotKnown) {
  TfBuffer tf(::ros::Duration(kHistory_s), 0.5);
  interrupt(tf);
  for (const double known : {100.0, 100.95, 101.0, 105.0, 105.55})
    EXPECT_TRUE(is_known(tf, known)) << known;
  for (const double unknown : {101.001, 103.0, 104.999}) {
    EXPECT_FALSE(is_known(tf, unknown)) << unknown;
    EXPECT_THROW(tf.look_up("patient", "us", ::ros::Time(unknown)), tf2::ExtrapolationException);
    EXPECT_THROW(tf.look_up("us", "patient", ::ros::Time(unknown)), tf2::ExtrapolationException);
  }
  std::string why;
  tf.can_transform("patient", "us", ::ros::Time(103.0), &why);
  EXPECT_THAT(why, AllOf(HasSubstr("'us'"), HasSubstr("'patient'"), HasSubstr("4.000 s"),
                         HasSubstr("101.000"), HasSubstr("105.000"), HasSubstr("max_tf_gap")));
}

/// A table or a calibration that is sent once in a second by a program that knows no static ones.
TEST(TfBuffer, AFrameThatStandsStillMayBeSentSeldom) {
  for (const double moved_mm : {0.0, 0.9, 1.1}) {
    TfBuffer tf(::ros::Duration(kHistory_s), 0.5);
    know(tf, 101.0, 5.0);
    know(tf, 105.0, 5.0 + moved_mm);
    EXPECT_EQ(is_known(tf, 103.0), moved_mm < 1.0) << moved_mm;
  }
  for (const double turned_rad : {0.009, 0.011}) {
    TfBuffer tf(::ros::Duration(kHistory_s), 0.5);
    know(tf, 101.0, 5.0);
    geometry_msgs::TransformStamped turned;
    turned.header.stamp = ::ros::Time(105.0);
    turned.header.frame_id = "patient";
    turned.child_frame_id = "us";
    turned.transform.translation.x = 5.0 / kMmPerM;
    turned.transform.rotation.y = std::sin(0.5 * turned_rad);
    turned.transform.rotation.w = std::cos(0.5 * turned_rad);
    ASSERT_TRUE(tf.set_transform(turned, "test", false));
    EXPECT_EQ(is_known(tf, 103.0), turned_rad < 0.01) << turned_rad;
  }
}

TEST(TfBuffer, AnyGapIsBridgedWhereThatIsAllowed) {
  for (const double max_gap_s : {0.0, 4.0}) {
    TfBuffer tf(::ros::Duration(kHistory_s), max_gap_s);
    interrupt(tf);
    EXPECT_NEAR(tf.look_up("patient", "us", ::ros::Time(103.0)).transform.translation.x * kMmPerM,
                20.0, 1e-6);
  }
}

/// Only frames that lie between the two count.
TEST(TfBuffer, GapsOfAllFramesInTheChainCountAndOfNoOthers) {
  const auto buffer = [](TfBuffer& tf, const std::string& interrupted) {
    for (const auto& [child, parent] : std::map<std::string, std::string>{
             {"us", "robot"}, {"robot", "base"}, {"patient", "base"}, {"base", "world"}}) {
      if (child == interrupted)
        interrupt(tf, child, parent);
      else
        know_from(tf, 100.0, 106.0, 0.0, child, parent);
    }
    interrupt(tf, "tool", "us");
    know(tf, 0.0, 0.0, "marker", "us", true);
  };
  for (const std::string inside : {"us", "robot", "patient"}) {
    TfBuffer tf(::ros::Duration(kHistory_s), 0.5);
    buffer(tf, inside);
    EXPECT_FALSE(is_known(tf, 103.0)) << inside;
    EXPECT_FALSE(tf.can_transform("patient", "marker", ::ros::Time(103.0))) << inside;
  }
  for (const std::string outside : {"base", "nothing"}) {
    TfBuffer tf(::ros::Duration(kHistory_s), 0.5);
    buffer(tf, outside);
    EXPECT_TRUE(is_known(tf, 103.0)) << outside;
    EXPECT_TRUE(tf.can_transform("us", "marker", ::ros::Time(103.0))) << outside;
  }
}

TEST(TfBuffer, WhatArrivesLateFillsAGap) {
  TfBuffer tf(::ros::Duration(kHistory_s), 0.5);
  interrupt(tf);
  know(tf, 102.0, 10.0);
  EXPECT_FALSE(is_known(tf, 101.5));
  EXPECT_FALSE(is_known(tf, 103.0));
  know_from(tf, 101.1, 101.9, 5.0);
  know_from(tf, 102.1, 104.9, 15.0);
  for (const double known : {101.5, 102.0, 103.0, 104.95}) EXPECT_TRUE(is_known(tf, known));
  know(tf, 98.0, 10.0);  // before the first
  EXPECT_FALSE(is_known(tf, 99.0));
}

TEST(TfBuffer, GapsAreForgottenWithTheTransforms) {
  TfBuffer tf(::ros::Duration(kHistory_s), 0.5);
  interrupt(tf);
  tf.clear();
  know_from(tf, 102.0, 104.0, 0.0);
  EXPECT_TRUE(is_known(tf, 103.0));
  // In a recording that is played again, gaps are those of its own, however far it was before.
  tf.clear();
  know_from(tf, 1000.0, 1001.0, 0.0);
  tf.clear();
  interrupt(tf);
  EXPECT_FALSE(is_known(tf, 103.0));

  TfGaps gaps(0.5, kHistory_s);
  for (const double stamp : {100.0, 101.0, 102.0}) gaps.heard("us", ::ros::Time(stamp));
  EXPECT_TRUE(gaps.find("us", ::ros::Time(100.5)));
  gaps.heard("us", ::ros::Time(161.5));
  EXPECT_FALSE(gaps.find("us", ::ros::Time(100.5)));
  EXPECT_TRUE(gaps.find("us", ::ros::Time(101.75)));
}

TEST(TfBuffer, WhoWaitsForATransformIsTold) {
  TfBuffer tf(::ros::Duration(kHistory_s), 0.5);
  interrupt(tf);
  try {
    wait_for_transform(tf, "patient", "us", ::ros::Time(103.0), 0.01);
    FAIL();
  } catch (const Refusal& refusal) {
    EXPECT_EQ(refusal.code(), Status::TF_UNAVAILABLE);
    EXPECT_THAT(refusal.what(), HasSubstr("max_tf_gap"));
  }
}

class FixedFrameInAGap : public testing::Test {
 protected:
  FixedFrameInAGap() {
    interrupt(tf_);
    options_.frame = "patient";
  }
  static std_msgs::Header us_at(double seconds) {
    std_msgs::Header header;
    header.frame_id = "us";
    header.stamp = ::ros::Time(seconds);
    return header;
  }
  template <typename Ask>
  static Refusal refusal(Ask&& ask) {
    try {
      ask();
    } catch (const Refusal& refusal) {
      return refusal;
    }
    return {Status::OK, "no refusal"};
  }
  TfBuffer tf_{::ros::Duration(kHistory_s), 0.5};
  FixedFrameOptions options_;
};

TEST_F(FixedFrameInAGap, ItsPoseIsRefused) {
  const FixedFrame frame(tf_, options_);
  EXPECT_FALSE(frame.reaches(us_at(103.0)));
  const Refusal refused = refusal([&] { frame.look_up(us_at(103.0)); });
  EXPECT_EQ(refused.code(), Status::TF_UNAVAILABLE);
  EXPECT_THAT(refused.what(), AllOf(HasSubstr("'us'"), HasSubstr("4.000 s"), HasSubstr("101.000"),
                                    HasSubstr("105.000"), HasSubstr("max_tf_gap")));
  EXPECT_NEAR(frame.look_up(us_at(105.5)).T_fixed_us.translation().x(), 40.0, 1e-6);
}

/// A motion in the window after the stamp would not be seen.
TEST_F(FixedFrameInAGap, TheWindowAfterTheStampIsNotComplete) {
  options_.jump_window_s = 0.2;
  const FixedFrame frame(tf_, options_);
  EXPECT_TRUE(frame.is_complete(us_at(100.75)));
  EXPECT_FALSE(frame.is_complete(us_at(100.9)));
}

TEST_F(FixedFrameInAGap, ASweepWithFramesInItIsRefused) {
  const FixedFrame frame(tf_, options_);
  const std_msgs::Header us = us_at(105.5);
  const FixedPose pose = frame.look_up(us);
  const Refusal refused = refusal([&] {
    frame.T_us_then(us, pose, {::ros::Time(100.5), ::ros::Time(103.0), ::ros::Time(105.5)});
  });
  EXPECT_EQ(refused.code(), Status::TF_UNAVAILABLE);
  EXPECT_THAT(refused.what(), HasSubstr("max_tf_gap"));
}

}  // namespace
}  // namespace usct::ros_interface
