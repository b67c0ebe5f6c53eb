#include "ros/crtk/arm_bridge.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <type_traits>
#include <utility>

#include "ros/conversions/checks.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::ros_interface {
namespace {

using Eigen::Isometry3d;

constexpr std::size_t kTrackLength = 50;
/// No arm is that long; a pose in millimetres is.
constexpr double kLongestMm = 10.0 * kMmPerM;

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text.empty() ? "none" : text;
}

/// Robots send a state again that has not been measured anew.
template <typename Track>
bool repeats(const std_msgs::Header& header, const Track& before) {
  return !before.empty() && before.back().stamp == header.stamp;
}

std::string joint_topic(const ArmBridgeOptions& options) { return options.name + "/measured_js"; }

}  // namespace

ArmBridge::ArmBridge(ArmBridgeOptions options, std::shared_ptr<const ArmModel> model)
    : options_(std::move(options)), model_(std::move(model)) {
  if (options_.joints.empty()) return;
  std::vector<std::string> prefixed;
  for (const std::string& joint : options_.joints)
    prefixed.push_back(options_.joint_prefix + joint);
  require(prefixed == model_->joints(), "arms/" + options_.name + "/joints",
          "are " + listed(prefixed) + " with the prefix, must be those of the model from '" +
              options_.base + "' to '" + options_.tip + "': " + listed(model_->joints()));
}

template <typename Message, typename Taken>
Taken ArmBridge::counted(Taken (ArmBridge::*taker)(const Message&, const ::ros::Time&),
                         const Message& message, const ::ros::Time& now, std::string& problem) try {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_time(now);
  const auto taken = (this->*taker)(message, now);
  ++report_.taken;
  problem.clear();
  constexpr bool kJoints = std::is_same_v<Message, sensor_msgs::JointState>;
  if (kJoints != options_.joints.empty()) report_.newest = message.header.stamp;
  return taken;
} catch (const InputError& error) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++report_.refused;
  problem = error.what();
  throw;
}

std::optional<geometry_msgs::TransformStamped> ArmBridge::take(
    const geometry_msgs::PoseStamped& message, const ::ros::Time& now) {
  return counted(&ArmBridge::take_pose, message, now, pose_problem_);
}

std::optional<sensor_msgs::JointState> ArmBridge::take(const sensor_msgs::JointState& message,
                                                       const ::ros::Time& now) {
  return counted(&ArmBridge::take_joints, message, now, joint_problem_);
}

void ArmBridge::refuse_pose(const std::string& problem) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++report_.refused;
  pose_problem_ = problem;
}

/// A recording that is played again begins anew.
void ArmBridge::notice_time(const ::ros::Time& now) {
  if (ran_back(now, last_now_)) {
    last_now_ = now;
    measured_.clear();
    modelled_.clear();
    agreed_ = ::ros::Time();
    contradiction_.clear();
    report_.newest = ::ros::Time();
  }
  last_now_ = std::max(last_now_, now);
}

void ArmBridge::require_usable(const std_msgs::Header& header, const Track& before,
                               const ::ros::Time& now, const std::string& topic) const {
  const ::ros::Time& stamp = header.stamp;
  require(!stamp.isZero(), topic, "'header.stamp' is 0, must be the time of the measurement");
  const double age_s = seconds_between(stamp, now);
  // Nothing is known of the time before simulated time begins.
  require(now.isZero() || std::abs(age_s) <= options_.max_age_s, topic,
          formatted("'header.stamp' is %.3f s %s the clock, must be <= %g s (max_age)",
                    std::abs(age_s), age_s > 0.0 ? "behind" : "ahead of", options_.max_age_s));
  require(before.empty() || before.back().stamp <= stamp, topic,
          "'header.stamp' is " + seconds_text(stamp) + ", must not be before that of the last" +
              (before.empty() ? "" : " message, " + seconds_text(before.back().stamp)));
}

std::optional<geometry_msgs::TransformStamped> ArmBridge::take_pose(
    const geometry_msgs::PoseStamped& message, const ::ros::Time& now) {
  const std::string topic = pose_topic();
  require_usable(message.header, measured_, now, topic);
  require(message.header.frame_id == options_.pose_frame, topic,
          "'header.frame_id' is '" + message.header.frame_id + "', must be '" +
              options_.pose_frame + "' (pose_frame)");
  const Isometry3d T = from_message_mm(message.pose, topic);
  if (repeats(message.header, measured_)) return std::nullopt;
  require(T.translation().norm() <= kLongestMm, topic,
          formatted("'pose.position' is %.1f m from the base, must be <= 10 m; is it in "
                    "millimetres?",
                    T.translation().norm() / kMmPerM));
  compare({message.header.stamp, T, {}}, measured_, modelled_);
  if (!options_.joints.empty()) return std::nullopt;
  return stamped_transform(message.header.stamp, T, options_.base, options_.tip);
}

std::vector<double> ArmBridge::positions(const sensor_msgs::JointState& message) const {
  const std::string topic = joint_topic(options_);
  require_count("position", message.position.size(), message.name.size(), topic);
  std::vector<double> found;
  for (const std::string& joint : options_.joints) {
    const auto name = std::find(message.name.begin(), message.name.end(), joint);
    require(name != message.name.end(), topic,
            "has no joint '" + joint + "'; it has: " + listed(message.name));
    found.push_back(message.position[static_cast<std::size_t>(name - message.name.begin())]);
    require(std::isfinite(found.back()), topic,
            formatted("'%s' is %g, must be finite", joint.c_str(), found.back()));
  }
  return found;
}

std::optional<sensor_msgs::JointState> ArmBridge::take_joints(
    const sensor_msgs::JointState& message, const ::ros::Time& now) {
  const std::string topic = joint_topic(options_);
  require_usable(message.header, modelled_, now, topic);
  sensor_msgs::JointState joints;
  joints.header = message.header;
  joints.name = model_->joints();
  joints.position = positions(message);
  const bool is_new = !repeats(message.header, modelled_);
  if (is_new) {
    if (modelled_.empty()) first_joints_ = message.header.stamp;
    compare({message.header.stamp, model_->T_base_tip(joints.position), joints.position}, modelled_,
            measured_);
  }
  // Joints that were refused are no better when they are sent again.
  if (options_.is_checked) require_agreement(message.header.stamp, topic);
  const bool may_be_used = !options_.is_checked || !agreed_.isZero();
  return is_new && may_be_used ? std::optional(joints) : std::nullopt;
}

void ArmBridge::require_agreement(const ::ros::Time& stamp, const std::string& topic) const {
  require(contradiction_.empty(), topic, contradiction_);
  const ::ros::Time& since = agreed_.isZero() ? first_joints_ : agreed_;
  require(seconds_between(since, stamp) <= options_.max_age_s, topic,
          "cannot be compared with " + options_.pose +
              formatted(": it has no stamp within %g s of those of the joints (pair_within) for "
                        "more than %g s (max_age)",
                        options_.pair_within_s, options_.max_age_s));
}

void ArmBridge::compare(Sample sample, Track& own, const Track& other) {
  own.push_back(std::move(sample));
  if (own.size() > kTrackLength) own.pop_front();
  const Sample& newest = own.back();
  if (const auto T = pose_at(other, newest.stamp))
    return judge(newest.stamp, newest.T_base_tip, *T);
  if (own.size() < 2) return;
  // The newest sample may be the later neighbour of samples that were waiting for it.
  const ::ros::Time& previous = own[own.size() - 2].stamp;
  for (auto waiting = other.rbegin(); waiting != other.rend() && waiting->stamp > previous;
       ++waiting)
    if (const auto T = pose_at(own, waiting->stamp))
      return judge(waiting->stamp, waiting->T_base_tip, *T);
}

std::optional<Isometry3d> ArmBridge::pose_at(const Track& track, const ::ros::Time& stamp) const {
  const auto after =
      std::lower_bound(track.begin(), track.end(), stamp,
                       [](const Sample& sample, const auto& time) { return sample.stamp < time; });
  if (after == track.end()) return std::nullopt;
  if (after->stamp == stamp) return after->T_base_tip;
  if (after == track.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double nearer_s =
      std::min(seconds_between(before->stamp, stamp), seconds_between(stamp, after->stamp));
  if (nearer_s > options_.pair_within_s) return std::nullopt;
  return interpolated(*before, *after, stamp);
}

Isometry3d ArmBridge::interpolated(const Sample& before, const Sample& after,
                                   const ::ros::Time& stamp) const {
  const double share =
      seconds_between(before.stamp, stamp) / seconds_between(before.stamp, after.stamp);
  if (!before.joints.empty()) {
    std::vector<double> joints = before.joints;
    for (std::size_t i = 0; i < joints.size(); ++i)
      joints[i] += share * (after.joints[i] - before.joints[i]);
    return model_->T_base_tip(joints);
  }
  const Eigen::Quaterniond turned =
      Eigen::Quaterniond(before.T_base_tip.linear())
          .slerp(share, Eigen::Quaterniond(after.T_base_tip.linear()));
  const Eigen::Vector3d moved =
      (1.0 - share) * before.T_base_tip.translation() + share * after.T_base_tip.translation();
  return Eigen::Translation3d(moved) * turned;
}

void ArmBridge::judge(const ::ros::Time& stamp, const Isometry3d& T_base_tip,
                      const Isometry3d& T_base_tip_other) {
  const Isometry3d difference = T_base_tip_other.inverse() * T_base_tip;
  const double apart_mm = difference.translation().norm();
  const double turned_deg = Eigen::AngleAxisd(difference.linear()).angle() / kDegree;
  report_.difference_mm = apart_mm;
  report_.difference_deg = turned_deg;
  contradiction_.clear();
  if (apart_mm <= options_.max_difference_mm && turned_deg <= options_.max_difference_deg)
    agreed_ = stamp;
  else
    contradiction_ =
        "contradicts " + options_.pose +
        formatted(
            ": joints and model have the tip %.1f mm and %.1f degrees away from it, must be <= %g "
            "mm and %g degrees; is robot_description that of this robot, its tool and its "
            "endoscope?",
            apart_mm, turned_deg, options_.max_difference_mm, options_.max_difference_deg);
}

ArmReport ArmBridge::report() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  ArmReport report = report_;
  report.leading_topic = options_.joints.empty() ? pose_topic() : joint_topic(options_);
  report.problem = joint_problem_.empty() ? pose_problem_ : joint_problem_;
  return report;
}

}  // namespace usct::ros_interface
