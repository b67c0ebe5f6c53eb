#include "ros/crtk/crtk_bridge.h"

#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

constexpr std::uint32_t kQueue = 100;

/// The payload of an arm's poses: a PoseStamped since CRTK 1.2 (dVRK 2.2), before that a
/// TransformStamped. Throws InputError for any other type.
geometry_msgs::PoseStamped pose_from(const topic_tools::ShapeShifter& message,
                                     const std::string& topic) {
  const std::string type = message.getDataType();
  if (type == "geometry_msgs/PoseStamped")
    return *message.instantiate<geometry_msgs::PoseStamped>();
  if (type != "geometry_msgs/TransformStamped")
    throw InputError(topic,
                     "is a " + type + ", must be a geometry_msgs/PoseStamped or TransformStamped");
  const auto transform = message.instantiate<geometry_msgs::TransformStamped>();
  geometry_msgs::PoseStamped pose;
  pose.header = transform->header;
  pose.pose.position.x = transform->transform.translation.x;
  pose.pose.position.y = transform->transform.translation.y;
  pose.pose.position.z = transform->transform.translation.z;
  pose.pose.orientation = transform->transform.rotation;
  return pose;
}

}  // namespace

CrtkBridge::CrtkBridge(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node), diagnostics_(node, private_node, private_node.getNamespace()) {
  const CrtkParameters parameters = read_crtk_parameters(node_, private_node);
  diagnostics_.setHardwareID("none");
  for (const ArmBridgeOptions& arm : parameters.arms) add_arm(arm, parameters.robot_description);
  if (!parameters.targets.targets.empty()) {
    targets_ = std::make_unique<TargetPublisher>(node_, parameters.targets);
    diagnostics_.add("targets", this, &CrtkBridge::diagnose_targets);
  }
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(parameters.diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); }));
}

void CrtkBridge::add_arm(const ArmBridgeOptions& options, const std::string& robot_description) {
  std::shared_ptr<const ArmModel> model;
  if (!options.joints.empty())
    model = std::make_shared<ArmModel>(robot_description, options.base, options.tip);
  arms_.push_back(std::make_unique<ArmBridge>(options, model));
  ArmBridge& bridge = *arms_.back();
  if (!options.pose.empty() && (options.joints.empty() || options.is_checked))
    subscribers_.push_back(node_.subscribe<topic_tools::ShapeShifter>(
        bridge.pose_topic(), kQueue,
        [this, &bridge](const topic_tools::ShapeShifter::ConstPtr& message) {
          take_pose(bridge, *message);
        }));
  if (!options.joints.empty()) {
    // A topic for each arm: robot_state_publisher keeps only the newest message, and would lose
    // those of one of two arms that measure at the same time.
    const ::ros::Publisher publisher =
        node_.advertise<sensor_msgs::JointState>(options.name + "/joint_states", kQueue);
    subscribers_.push_back(node_.subscribe<sensor_msgs::JointState>(
        options.name + "/measured_js", kQueue,
        [this, &bridge, publisher](const sensor_msgs::JointStateConstPtr& message) {
          take_joints(bridge, publisher, *message);
        }));
  }
  diagnostics_.add(options.name,
                   [this, &bridge](diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
                     diagnose_arm(bridge, diagnosis);
                   });
}

void CrtkBridge::take_pose(ArmBridge& arm, const topic_tools::ShapeShifter& message) try {
  geometry_msgs::PoseStamped pose;
  try {
    pose = pose_from(message, arm.pose_topic());
  } catch (const std::exception& error) {
    arm.refuse_pose(error.what());
    throw;
  }
  const auto transform = arm.take(pose, ::ros::Time::now());
  if (transform) broadcaster_.sendTransform(*transform);
} catch (const std::exception& error) {
  ROS_ERROR_THROTTLE(1.0, "%s", error.what());
}

void CrtkBridge::take_joints(ArmBridge& arm, const ::ros::Publisher& publisher,
                             const sensor_msgs::JointState& message) try {
  const auto joints = arm.take(message, ::ros::Time::now());
  if (joints) publisher.publish(*joints);
} catch (const InputError& error) {
  ROS_ERROR_THROTTLE(1.0, "%s", error.what());
}

void CrtkBridge::diagnose_arm(const ArmBridge& arm,
                              diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  using diagnostic_msgs::DiagnosticStatus;
  const ArmReport report = arm.report();
  const double age_s = seconds_between(report.newest, ::ros::Time::now());
  if (!report.problem.empty())
    diagnosis.summary(DiagnosticStatus::ERROR, "refused: " + report.problem);
  else if (report.newest.isZero())
    diagnosis.summary(DiagnosticStatus::WARN, "nothing has arrived on " + report.leading_topic);
  else if (age_s > arm.options().max_age_s)
    diagnosis.summary(DiagnosticStatus::WARN, "nothing has arrived on " + report.leading_topic +
                                                  " for " + seconds_text(age_s) + " s");
  else
    diagnosis.summary(DiagnosticStatus::OK, "connected");
  diagnosis.add("messages taken", report.taken);
  diagnosis.add("messages refused", report.refused);
  diagnosis.add("newest stamp", seconds_text(report.newest));
  if (!report.difference_mm) return;
  const std::string compared = arm.options().pose + " from joints and model ";
  diagnosis.add(compared + "(mm)", *report.difference_mm);
  diagnosis.add(compared + "(deg)", *report.difference_deg);
}

void CrtkBridge::diagnose_targets(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  using diagnostic_msgs::DiagnosticStatus;
  const TargetPublisher::Report report = targets_->report();
  diagnosis.summary(DiagnosticStatus::OK, "published");
  for (const std::string& warning : report.warnings)
    diagnosis.mergeSummary(DiagnosticStatus::WARN, warning);
  if (!report.problem.empty())
    diagnosis.mergeSummary(DiagnosticStatus::WARN, "not published: " + report.problem);
}

}  // namespace usct::ros_interface
