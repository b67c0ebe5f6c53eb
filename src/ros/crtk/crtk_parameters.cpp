#include "ros/crtk/crtk_parameters.h"

#include <charconv>

#include "ros/conversions/checks.h"
#include "ros/conversions/poses.h"
#include "ros/node/parameters.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using XmlRpc::XmlRpcValue;
using Members = std::map<std::string, XmlRpcValue>;

/// The members of one entry of a map of maps, each of which must be used.
class Entry {
 public:
  Entry(std::string name, Members members) : name_(std::move(name)), members_(std::move(members)) {}

  std::string text(const std::string& key, const std::string& fallback) {
    return find(key, XmlRpcValue::TypeString, "a text") ? static_cast<std::string>(members_[key])
                                                        : fallback;
  }
  bool flag(const std::string& key, bool fallback) {
    return find(key, XmlRpcValue::TypeBoolean, "true or false") ? static_cast<bool>(members_[key])
                                                                : fallback;
  }
  std::string frame(const std::string& key) {
    const std::string found = text(key, "");
    require(!found.empty() && found.front() != '/', name_ + "/" + key,
            "is '" + found + "', must be the name of a frame, without leading /");
    return found;
  }
  std::vector<std::string> texts(const std::string& key) {
    std::vector<std::string> found;
    if (!find(key, XmlRpcValue::TypeArray, "a list")) return found;
    for (int i = 0; i < members_[key].size(); ++i) {
      require(members_[key][i].getType() == XmlRpcValue::TypeString, name_ + "/" + key,
              "must be a list of texts");
      found.push_back(static_cast<std::string>(members_[key][i]));
    }
    return found;
  }
  /// A checksum, which is written as a text: half of them exceed the integers of parameters.
  std::uint32_t crc32(const std::string& key) {
    const std::string found = text(key, "");
    std::uint32_t value = 0;
    const char* const end = found.data() + found.size();
    const auto [last, error] = std::from_chars(found.data(), end, value);
    require(error == std::errc() && last == end, name_ + "/" + key,
            "is '" + found + "', must be the crc32 of the CT as ct/info has it, in quotes");
    return value;
  }
  void know(const std::string& key) { known_.insert(key); }
  /// Throws InputError for a key that was not asked for.
  void finish() const {
    for (const auto& [key, value] : members_)
      require(known_.count(key) > 0, name_ + "/" + key, "is not a parameter");
  }

 private:
  bool find(const std::string& key, XmlRpcValue::Type type, const std::string& kind) {
    known_.insert(key);
    const auto found = members_.find(key);
    if (found == members_.end()) return false;
    require(found->second.getType() == type, name_ + "/" + key, "must be " + kind);
    return true;
  }

  const std::string name_;
  Members members_;
  std::set<std::string> known_;
};

ArmBridgeOptions read_arm(const std::string& name, const Members& members,
                          ArmBridgeOptions options) {
  Entry entry("arms/" + name, members);
  options.name = name;
  options.base = entry.frame("base");
  options.tip = entry.frame("tip");
  options.pose_frame = entry.text("pose_frame", options.base);
  options.joints = entry.texts("joints");
  options.joint_prefix = entry.text("joint_prefix", name + "_");
  options.pose = entry.text("pose", options.pose);
  options.is_checked = !options.pose.empty() && entry.flag("check", true);
  entry.finish();
  require(!options.joints.empty() || !options.pose.empty(), "arms/" + name,
          "has neither 'joints' nor 'pose', must have one of them");
  return options;
}

Target read_target(const std::string& name, const Members& members) {
  Target target;
  target.name = name;
  const auto surface = members.find("surface");
  const auto point = members.find("point");
  const std::string path = "targets/" + name;
  require((surface != members.end()) != (point != members.end()), path,
          "must have either 'surface' or 'point'");
  Entry entry(path, members);
  if (surface != members.end()) {
    target.surface = entry.text("surface", "");
    entry.finish();
    require(!target.surface.empty(), path + "/surface",
            "is empty, must name a structure of ct/surface");
    return target;
  }
  target.ct_crc32 = entry.crc32("ct_crc32");
  entry.know("point");
  entry.finish();
  XmlRpcValue numbers = point->second;
  const std::string constraint = "must be a list of three numbers (x, y, z in the CT, m)";
  require(numbers.getType() == XmlRpcValue::TypeArray && numbers.size() == 3, path + "/point",
          constraint);
  for (int i = 0; i < 3; ++i) {
    target.point_mm[i] = kMmPerM * as_number(numbers[i], path + "/point");
  }
  require(target.point_mm.allFinite(), path + "/point", constraint);
  return target;
}

}  // namespace

CrtkParameters read_crtk_parameters(const ::ros::NodeHandle& node,
                                    const ::ros::NodeHandle& private_node) {
  Parameters parameters(private_node);
  CrtkParameters read;
  ArmBridgeOptions common;
  common.max_age_s = parameters.number("max_age", 0.5, 0.001, 60.0);
  common.pair_within_s = parameters.number("pair_within", 0.002, 0.0, 1.0);
  common.max_difference_mm = kMmPerM * parameters.number("max_difference", 0.002, 0.0, 1.0);
  common.max_difference_deg = parameters.number("max_difference_deg", 2.0, 0.0, 180.0);
  for (const auto& [name, members] : parameters.groups("arms"))
    read.arms.push_back(read_arm(name, members, common));
  for (const auto& [name, members] : parameters.groups("targets"))
    read.targets.targets.push_back(read_target(name, members));
  read.targets.frame = parameters.frame("target_frame", "");
  read.targets.rate_hz = parameters.number("target_rate", 10.0, 0.1, 1000.0);
  read.targets.tf_timeout_s = parameters.number("tf_timeout", 0.1, 0.0, 10.0);
  read.diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  require(read.targets.targets.empty() || !read.targets.frame.empty(), "target_frame",
          "is empty, must name the frame in which the targets are published");
  for (const ArmBridgeOptions& arm : read.arms)
    if (!arm.joints.empty() && read.robot_description.empty())
      require(node.getParam("robot_description", read.robot_description), "robot_description",
              "is not set, must be the robot's model (URDF): arms/" + arm.name + " has joints");
  return read;
}

}  // namespace usct::ros_interface
