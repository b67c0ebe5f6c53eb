#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>
#include <sensor_msgs/JointState.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "ros/crtk/arm_model.h"

namespace usct::ros_interface {

/// One arm of a robot that speaks CRTK, such as dVRK's PSM1.
struct ArmBridgeOptions {
  /// The arm's namespace.
  std::string name;
  /// tf frames between which the arm's kinematics lie.
  std::string base;
  std::string tip;
  /// Topic of the poses in the arm's namespace; empty: none.
  std::string pose = "measured_cp";
  /// The `header.frame_id` that they must have.
  std::string pose_frame;
  /// Names in `measured_js` of the joints from base to tip. If there are any, the arm's poses in tf
  /// come from them and the model; else from `pose`.
  std::vector<std::string> joints;
  /// The model has the joints by these names with this prefix: an arm does not know its own name.
  std::string joint_prefix;
  /// Whether the poses must agree with joints and model. Needs `joints`.
  bool is_checked = true;
  /// The largest difference with which they agree.
  double max_difference_mm = 2.0;
  double max_difference_deg = 2.0;
  /// A pose and joints are compared if their stamps are equal. Else the stamp of the one must lie
  /// between two stamps of the other, the nearer of which differs by no more than this, s; what the
  /// other would say is interpolated.
  double pair_within_s = 0.002;
  /// Messages with stamps further from the clock are refused, s; joints as well if the last
  /// comparison is older.
  double max_age_s = 0.5;
};

/// Counts of the messages of an arm, and the last comparison of its poses with its joints.
struct ArmReport {
  /// The topic from which tf has the arm's poses: its joints, if it has any.
  std::string leading_topic;
  /// Messages of both kinds.
  std::uint64_t taken = 0;
  std::uint64_t refused = 0;
  /// The reason why the last message of either kind was refused; empty if both were taken.
  std::string problem;
  /// The last comparison of its poses with joints and model.
  std::optional<double> difference_mm;
  std::optional<double> difference_deg;
  /// The stamp of the newest message of the leading topic that was taken; 0 if there was none.
  ::ros::Time newest;
};

/// Turns the messages of an arm into those of tf and robot_state_publisher, with their stamps, and
/// refuses what is wrong: each `take` throws InputError, naming the topic, for numbers that are not
/// finite, quaternions that are no rotations, wrong frames, missing joints, stamps that are 0, old,
/// ahead of `now` or not in order, and for joints that contradict `measured_cp`. May be called from
/// any thread.
class ArmBridge {
 public:
  /// Throws InputError, naming the arm, if the joints are not those of `model`, which may be null
  /// if there are none.
  ArmBridge(ArmBridgeOptions options, std::shared_ptr<const ArmModel> model);

  /// The transform to broadcast; none if the arm's poses come from its joints.
  std::optional<geometry_msgs::TransformStamped> take(const geometry_msgs::PoseStamped& message,
                                                      const ::ros::Time& now);
  /// The joints with the names of the model. Joints whose comparison with `measured_cp` is still to
  /// come give nothing.
  std::optional<sensor_msgs::JointState> take(const sensor_msgs::JointState& message,
                                              const ::ros::Time& now);

  /// Counts a message that cannot even be read as a pose, for the reason `problem`.
  void refuse_pose(const std::string& problem);

  const ArmBridgeOptions& options() const { return options_; }
  /// The full name of the topic of its poses.
  std::string pose_topic() const { return options_.name + "/" + options_.pose; }
  ArmReport report() const;

 private:
  /// The pose of the tip in the base, mm, and the joints from which it was computed, if it was.
  struct Sample {
    ::ros::Time stamp;
    Eigen::Isometry3d T_base_tip;
    std::vector<double> joints;
  };
  /// The newest is the last.
  using Track = std::deque<Sample>;

  template <typename Message, typename Taken>
  Taken counted(Taken (ArmBridge::*taker)(const Message&, const ::ros::Time&),
                const Message& message, const ::ros::Time& now, std::string& problem);
  std::optional<geometry_msgs::TransformStamped> take_pose(
      const geometry_msgs::PoseStamped& message, const ::ros::Time& now);
  std::optional<sensor_msgs::JointState> take_joints(const sensor_msgs::JointState& message,
                                                     const ::ros::Time& now);
  /// Throws InputError unless joints of this time and `measured_cp` say the same, or may still.
  void require_agreement(const ::ros::Time& stamp, const std::string& topic) const;
  /// Positions of `options_.joints`, in this order.
  std::vector<double> positions(const sensor_msgs::JointState& message) const;
  void require_usable(const std_msgs::Header& header, const Track& before, const ::ros::Time& now,
                      const std::string& topic) const;
  /// Adds a sample to one track and compares the newest sample of either for which the other is
  /// known at its stamp. If stamps are not equal, only the later of two neighbours shows where the
  /// arm was between them.
  void compare(Sample sample, Track& own, const Track& other);
  /// The pose of the tip at a stamp; empty if the track does not say.
  std::optional<Eigen::Isometry3d> pose_at(const Track& track, const ::ros::Time& stamp) const;
  Eigen::Isometry3d interpolated(const Sample& before, const Sample& after,
                                 const ::ros::Time& stamp) const;
  /// Takes up the comparison of poses of one stamp.
  void judge(const ::ros::Time& stamp, const Eigen::Isometry3d& T_base_tip,
             const Eigen::Isometry3d& T_base_tip_other);
  void notice_time(const ::ros::Time& now);

  const ArmBridgeOptions options_;
  const std::shared_ptr<const ArmModel> model_;
  mutable std::mutex mutex_;  // guards all below
  ArmReport report_;
  std::string pose_problem_;
  std::string joint_problem_;
  Track measured_;
  Track modelled_;
  ::ros::Time last_now_;
  ::ros::Time first_joints_;
  ::ros::Time agreed_;  // stamp of the last comparison that agreed; 0: none
  std::string contradiction_;
};

}  // namespace usct::ros_interface
