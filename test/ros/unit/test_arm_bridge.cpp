#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "nan.h"
#include "ros/conversions/poses.h"
#include "ros/crtk/arm_bridge.h"
#include "ros/crtk/target_publisher.h"
#include "test_paths.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using testing::HasSubstr;

const std::vector<std::string> kJoints = {"yaw",  "pitch",       "insertion",
                                          "roll", "wrist_pitch", "wrist_yaw"};

std::string robot_description() {
  std::ifstream file(USCT_SOURCE_DIR "/urdf/integration.urdf");
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

/// The pose that the comment in the model states.
Isometry3d T_base_tip(const std::vector<double>& q, double tool_mm) {
  const auto about = [](double angle, const Vector3d& axis) {
    return Isometry3d(AngleAxisd(angle, axis));
  };
  const auto along = [](double mm) { return Eigen::Translation3d(0.0, 0.0, mm); };
  const Vector3d x = Vector3d::UnitX();
  const Vector3d y = Vector3d::UnitY();
  return about(q[0], y) * about(q[1], x) * along(1000.0 * q[2]) * about(q[3], Vector3d::UnitZ()) *
         about(q[4], x) * about(q[5], y) * along(tool_mm);
}

std::string refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "not refused";
}

class ArmBridgeTest : public testing::Test {
 protected:
  ArmBridgeTest() {
    options_.name = "PSM1";
    options_.base = options_.pose_frame = "PSM1_base";
    options_.tip = "PSM1_tool_tip";
    options_.joint_prefix = "PSM1_";
  }
  ArmBridge of_poses() const { return {options_, nullptr}; }
  ArmBridge of_joints() {
    options_.joints = kJoints;
    return {options_, std::make_shared<ArmModel>(robot_description(), options_.base, options_.tip)};
  }

  static geometry_msgs::PoseStamped pose(double time_s, const Isometry3d& T_mm) {
    geometry_msgs::PoseStamped message;
    message.header.stamp = ::ros::Time(time_s);
    message.header.frame_id = "PSM1_base";
    message.pose = to_pose_message(T_mm);
    return message;
  }
  /// The joints as the dVRK names them, and the jaw, which the chain does not have.
  static sensor_msgs::JointState joints(double time_s, const std::vector<double>& positions) {
    sensor_msgs::JointState message;
    message.header.stamp = ::ros::Time(time_s);
    message.name = kJoints;
    message.position = positions;
    message.name.insert(message.name.begin(), "jaw");
    message.position.insert(message.position.begin(), 0.3);
    return message;
  }

  ArmBridgeOptions options_;
  const ::ros::Time now_{100.0};
  const Isometry3d T_{Eigen::Translation3d(3.0, -2.0, 90.0) *
                      AngleAxisd(0.4, Vector3d(1.0, 2.0, 2.0) / 3.0)};
  const std::vector<double> q_ = {0.1, -0.2, 0.12, 1.0, -0.3, 0.2};
};

RC_GTEST_FIXTURE_PROP(ArmBridgeTest, the_model_has_the_kinematics_that_it_states, ()) {
  std::vector<double> q;
  for (std::size_t i = 0; i < kJoints.size(); ++i)
    q.push_back(0.001 * *rc::gen::inRange(i == 2 ? 0 : -1500, i == 2 ? 350 : 1500));
  for (const auto& [base, tip, tool_mm] : {std::tuple("PSM1_base", "PSM1_tool_tip", 10.2),
                                           std::tuple("ECM_base", "endoscope_tip", 25.0)})
    RC_ASSERT(ArmModel(robot_description(), base, tip)
                  .T_base_tip(q)
                  .isApprox(T_base_tip(q, tool_mm), 1e-9));
}

TEST_F(ArmBridgeTest, PosesBecomeTfWithTheirStamps) {
  ArmBridge arm = of_poses();
  const auto transform = arm.take(pose(99.9, T_), now_);
  ASSERT_TRUE(transform);
  EXPECT_EQ(transform->header.stamp, ::ros::Time(99.9));
  EXPECT_EQ(transform->header.frame_id, "PSM1_base");
  EXPECT_EQ(transform->child_frame_id, "PSM1_tool_tip");
  EXPECT_TRUE(from_message_mm(transform->transform, "test").isApprox(T_, 1e-9));
  EXPECT_FALSE(arm.take(pose(99.9, T_), now_)) << "the same state again";
  EXPECT_EQ(arm.report().refused, 0U);
}

TEST_F(ArmBridgeTest, AMessageThatIsNoPoseIsAProblemUntilAPoseIsTaken) {
  ArmBridge arm = of_poses();
  arm.refuse_pose("is a std_msgs/Header");
  EXPECT_EQ(arm.report().problem, "is a std_msgs/Header");
  EXPECT_EQ(arm.report().refused, 1U);
  arm.take(pose(99.9, T_), now_);
  EXPECT_EQ(arm.report().problem, "");
}

TEST_F(ArmBridgeTest, NamesTheTopicOfItsPoses) {
  options_.pose = "local/measured_cp";
  ArmBridge arm = of_poses();
  EXPECT_EQ(arm.report().leading_topic, "PSM1/local/measured_cp");
  EXPECT_THAT(refusal([&] { arm.take(pose(0.0, T_), now_); }),
              HasSubstr("PSM1/local/measured_cp: 'header.stamp' is 0"));
}

TEST_F(ArmBridgeTest, WrongPosesAreRefused) {
  ArmBridge arm = of_poses();
  arm.take(pose(99.9, T_), now_);
  const auto refused = [&](double time_s,
                           const std::function<void(geometry_msgs::PoseStamped&)>& spoil) {
    geometry_msgs::PoseStamped message = pose(time_s, T_);
    spoil(message);
    return refusal([&] { arm.take(message, now_); });
  };
  const auto nothing = [](auto&) {};
  EXPECT_THAT(refused(0.0, nothing), HasSubstr("'header.stamp' is 0"));
  EXPECT_THAT(refused(99.0, nothing), HasSubstr("1.000 s behind the clock, must be <= 0.5 s"));
  EXPECT_THAT(refused(101.0, nothing), HasSubstr("1.000 s ahead of the clock"));
  EXPECT_THAT(refused(99.8, nothing),
              HasSubstr("must not be before that of the last message, 99.900"));
  EXPECT_THAT(refused(99.95, [](auto& m) { m.header.frame_id = "ECM"; }),
              HasSubstr("'header.frame_id' is 'ECM', must be 'PSM1_base'"));
  EXPECT_THAT(refused(99.95, [](auto& m) { m.pose.orientation.w += 0.1; }),
              HasSubstr("PSM1/measured_cp"));
  EXPECT_THAT(refused(99.95, [](auto& m) { m.pose.orientation = {}; }),
              HasSubstr("PSM1/measured_cp"));
  EXPECT_THAT(refused(99.95, [](auto& m) { m.pose.position.x = test::kNan; }),
              HasSubstr("PSM1/measured_cp"));
  EXPECT_THAT(refused(99.95, [](auto& m) { m.pose.position.z = 90.0; }), HasSubstr("millimetres?"));
  EXPECT_EQ(arm.report().refused, 9U);
  EXPECT_THAT(arm.report().problem, HasSubstr("millimetres?"));
  EXPECT_TRUE(arm.take(pose(99.95, T_), now_)) << "the next good one is taken";
  EXPECT_EQ(arm.report().problem, "");
}

TEST_F(ArmBridgeTest, JointsThatAgreeWithThePoseGetTheNamesOfTheModel) {
  ArmBridge arm = of_joints();
  EXPECT_FALSE(arm.take(joints(99.9, q_), now_)) << "not compared yet";
  EXPECT_FALSE(arm.take(pose(99.9, T_base_tip(q_, 10.2)), now_)) << "tf comes from the joints";
  const auto taken = arm.take(joints(99.91, q_), now_);
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->header.stamp, ::ros::Time(99.91));
  EXPECT_EQ(taken->name[2], "PSM1_insertion");
  EXPECT_EQ(taken->position, q_);
  EXPECT_NEAR(arm.report().difference_mm.value(), 0.0, 1e-6);
}

TEST_F(ArmBridgeTest, JointsThatContradictThePoseAreRefusedUntilTheyAgree) {
  ArmBridge arm = of_joints();
  // A tool that is 5 mm longer than the model's.
  arm.take(pose(99.9, T_base_tip(q_, 15.2)), now_);
  EXPECT_THAT(
      refusal([&] { arm.take(joints(99.9, q_), now_); }),
      HasSubstr("contradicts measured_cp: joints and model have the tip 5.0 mm and 0.0 degrees"));
  EXPECT_NEAR(arm.report().difference_mm.value(), 5.0, 1e-6);
  EXPECT_THAT(refusal([&] { arm.take(joints(99.95, q_), now_); }), HasSubstr("contradicts"));
  arm.take(pose(99.96, T_base_tip(q_, 10.2)), now_);
  EXPECT_TRUE(arm.take(joints(99.96, q_), now_));
}

TEST_F(ArmBridgeTest, JointsThatCannotBeComparedAreRefused) {
  ArmBridge arm = of_joints();
  EXPECT_FALSE(arm.take(joints(99.5, q_), now_));
  EXPECT_FALSE(arm.take(joints(100.0, q_), now_));
  EXPECT_THAT(refusal([&] { arm.take(joints(100.1, q_), now_); }), HasSubstr("cannot be compared"));
  options_.is_checked = false;
  ArmBridge unchecked = of_joints();
  EXPECT_TRUE(unchecked.take(joints(99.9, q_), now_));
}

/// An arm that moves at 0.15 m/s, with a model that is `wrong_mm` off, and messages at 100 Hz whose
/// poses have stamps `apart_s` after those of the joints and arrive `lag` messages later.
struct MovingArm {
  double apart_s = 0.0;
  int lag = 0;
  double wrong_mm = 0.0;
  int given = 0;
  int refused = 0;
  double largest_mm = 0.0;

  void run(ArmBridge& arm, const std::function<geometry_msgs::PoseStamped(double)>& pose,
           const std::function<sensor_msgs::JointState(double)>& joints) {
    constexpr double kPeriodS = 0.01;
    constexpr int kMessages = 200;
    for (int i = 0; i < kMessages; ++i) {
      const double time_s = 100.0 + kPeriodS * i;
      try {
        if (arm.take(joints(time_s), ::ros::Time(time_s))) ++given;
      } catch (const InputError&) {
        ++refused;
      }
      if (i < lag) continue;
      arm.take(pose(time_s - kPeriodS * lag + apart_s), ::ros::Time(time_s));
      largest_mm = std::max(largest_mm, arm.report().difference_mm.value_or(0.0));
    }
  }
};

class MovingArmTest : public ArmBridgeTest {
 protected:
  /// `pair_within_s`: that of the arm.
  MovingArm moved(MovingArm arm, double pair_within_s) {
    options_.pair_within_s = pair_within_s;
    ArmBridge bridge = of_joints();
    arm.run(
        bridge,
        [&](double time_s) { return pose(time_s, T_base_tip(at(time_s), 10.2 + arm.wrong_mm)); },
        [&](double time_s) { return joints(time_s, at(time_s)); });
    return arm;
  }

 private:
  /// The insertion moves at 0.15 m/s, and the roll turns.
  std::vector<double> at(double time_s) const {
    std::vector<double> q = q_;
    q[2] += 0.15 * (time_s - 100.0);
    q[3] += 0.5 * (time_s - 100.0);
    return q;
  }
};

TEST_F(MovingArmTest, APoseIsComparedWithTheJointsOfItsInstantHoweverLateItComes) {
  for (const double pair_within_s : {0.0, 0.002, 0.02, 0.1})
    for (const int lag : {0, 1, 3}) {
      const MovingArm arm = moved({0.0, lag}, pair_within_s);
      EXPECT_EQ(arm.refused, 0) << pair_within_s << " " << lag;
      // Those that came before the first pose of their time give nothing.
      EXPECT_EQ(arm.given, 200 - 1 - lag) << pair_within_s << " " << lag;
      EXPECT_LT(arm.largest_mm, 1e-3) << pair_within_s << " " << lag;
    }
}

TEST_F(MovingArmTest, StampsThatAreNeverEqualAreComparedByInterpolation) {
  for (const auto& [apart_s, pair_within_s] :
       {std::pair(0.001, 0.002), std::pair(-0.001, 0.002), std::pair(0.005, 0.01),
        std::pair(0.005, 0.1), std::pair(0.007, 0.02), std::pair(-0.004, 0.005)}) {
    const MovingArm right = moved({apart_s, 1}, pair_within_s);
    EXPECT_EQ(right.refused, 0) << apart_s;
    EXPECT_GE(right.given, 195) << apart_s;
    EXPECT_LT(right.largest_mm, 0.01) << apart_s;
    const MovingArm wrong = moved({apart_s, 1, 5.0}, pair_within_s);
    EXPECT_EQ(wrong.given, 0) << apart_s;
    EXPECT_NEAR(wrong.largest_mm, 5.0, 0.01) << apart_s;
  }
  // No stamps are within 1 ms of each other: after max_age, all joints are refused.
  const MovingArm never = moved({0.005, 1}, 0.001);
  EXPECT_EQ(never.given, 0);
  EXPECT_EQ(never.refused, 200 - 51);
}

TEST_F(ArmBridgeTest, WrongJointsAreRefused) {
  ArmBridge arm = of_joints();
  sensor_msgs::JointState message = joints(99.9, q_);
  message.name[3] = "insertion_joint";
  EXPECT_THAT(refusal([&] { arm.take(message, now_); }),
              HasSubstr("PSM1/measured_js: has no joint 'insertion'; it has: 'jaw', 'yaw', "
                        "'pitch', 'insertion_joint'"));
  message = joints(99.9, q_);
  message.position.pop_back();
  EXPECT_THAT(refusal([&] { arm.take(message, now_); }), HasSubstr("position"));
  message = joints(99.9, q_);
  message.position[3] = test::kNan;
  EXPECT_THAT(refusal([&] { arm.take(message, now_); }),
              HasSubstr("'insertion' is nan, must be finite"));
  options_.joints = kJoints;
  options_.joints.pop_back();
  EXPECT_THAT(refusal([&] {
                ArmBridge(options_, std::make_shared<ArmModel>(robot_description(), options_.base,
                                                               options_.tip));
              }),
              HasSubstr("must be those of the model from 'PSM1_base' to 'PSM1_tool_tip'"));
}

TEST_F(ArmBridgeTest, AClockThatRunsBackBeginsAnew) {
  ArmBridge arm = of_poses();
  arm.take(pose(99.9, T_), now_);
  EXPECT_TRUE(arm.take(pose(50.0, T_), ::ros::Time(50.1)));
}

TEST_F(ArmBridgeTest, AClockThatRunsBackForgetsWhatJointsWereComparedWith) {
  ArmBridge arm = of_joints();
  arm.take(pose(99.9, T_base_tip(q_, 10.2)), now_);
  EXPECT_TRUE(arm.take(joints(99.9, q_), now_));
  // The comparison of the time before says nothing of this robot now.
  EXPECT_FALSE(arm.take(joints(50.0, q_), ::ros::Time(50.0))) << "not compared yet";
  EXPECT_FALSE(arm.take(pose(50.05, T_base_tip(q_, 10.2)), ::ros::Time(50.05)));
  EXPECT_TRUE(arm.take(joints(50.05, q_), ::ros::Time(50.05)));
  // A contradiction of the time before is forgotten as well.
  arm.take(pose(50.1, T_base_tip(q_, 15.2)), ::ros::Time(50.1));
  EXPECT_THAT(refusal([&] { arm.take(joints(50.1, q_), ::ros::Time(50.1)); }),
              HasSubstr("contradicts"));
  EXPECT_FALSE(arm.take(joints(20.0, q_), ::ros::Time(20.0)));
}

TEST_F(ArmBridgeTest, JointsThatContradictThePoseByAnAngleAloneAreRefused) {
  ArmBridge arm = of_joints();
  const Isometry3d T_turned = T_base_tip(q_, 10.2) * AngleAxisd(0.1, Vector3d::UnitZ());
  arm.take(pose(99.9, T_turned), now_);
  EXPECT_THAT(refusal([&] { arm.take(joints(99.9, q_), now_); }),
              HasSubstr("joints and model have the tip 0.0 mm and 5.7 degrees"));
}

TEST_F(ArmBridgeTest, TheSameJointsAgainAreNotPublishedAgain) {
  ArmBridge arm = of_joints();
  arm.take(pose(99.9, T_base_tip(q_, 10.2)), now_);
  EXPECT_TRUE(arm.take(joints(99.9, q_), now_));
  EXPECT_FALSE(arm.take(joints(99.9, q_), now_));
}

/// Robots send a state again. That must not end the error that the joints are.
TEST_F(ArmBridgeTest, RefusedJointsStayRefusedWhenTheyAreSentAgain) {
  ArmBridge arm = of_joints();
  arm.take(pose(99.9, T_base_tip(q_, 15.2)), now_);
  for (int sent = 0; sent < 2; ++sent)
    EXPECT_THAT(refusal([&] { arm.take(joints(99.9, q_), now_); }), HasSubstr("contradicts"));
  EXPECT_THAT(arm.report().problem, HasSubstr("contradicts"));
  EXPECT_TRUE(arm.report().newest.isZero());
}

/// The report tells of the topic that tf depends on: while its joints are silent, an arm whose
/// poses arrive is not connected.
TEST_F(ArmBridgeTest, TheReportIsThatOfTheTopicThatLeads) {
  ArmBridge by_joints = of_joints();
  by_joints.take(pose(99.9, T_base_tip(q_, 10.2)), now_);
  EXPECT_EQ(by_joints.report().leading_topic, "PSM1/measured_js");
  EXPECT_TRUE(by_joints.report().newest.isZero());
  by_joints.take(joints(99.91, q_), now_);
  by_joints.take(pose(99.95, T_base_tip(q_, 10.2)), now_);
  EXPECT_EQ(by_joints.report().newest, ::ros::Time(99.91));
  options_.joints.clear();
  ArmBridge by_poses = of_poses();
  by_poses.take(pose(99.9, T_), now_);
  EXPECT_EQ(by_poses.report().leading_topic, "PSM1/measured_cp");
  EXPECT_EQ(by_poses.report().newest, ::ros::Time(99.9));
}

TEST(ArmModel, RefusesWhatIsNoModelOrHasNoChain) {
  EXPECT_THAT(refusal([] { ArmModel("<robot", "a", "b"); }), HasSubstr("is not a URDF model"));
  EXPECT_THAT(refusal([] { ArmModel(robot_description(), "PSM1_base", "PSM2_tool_tip"); }),
              HasSubstr("has no chain from 'PSM1_base' to 'PSM2_tool_tip'"));
  EXPECT_THAT(refusal([] { ArmModel(robot_description(), "robot_base", "PSM1_base"); }),
              HasSubstr("has no movable joint"));
}

TEST(CentreOfVolume, IsThatOfATetrahedronAnywhere) {
  // The centre of a tetrahedron is the mean of its corners.
  const Vector3d at(100.0, -200.0, 300.0);
  Surface surface;
  surface.points_mm = {at, at + Vector3d(4.0, 0.0, 0.0), at + Vector3d(0.0, 8.0, 0.0),
                       at + Vector3d(0.0, 0.0, 12.0)};
  surface.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  EXPECT_TRUE(centre_of_volume_mm(surface).isApprox(at + Vector3d(1.0, 2.0, 3.0), 1e-12));
  EXPECT_FALSE(centre_of_volume_mm(Surface()).allFinite());
}

}  // namespace
}  // namespace usct::ros_interface
