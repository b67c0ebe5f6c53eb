#include "ros/registration/registration_parameters.h"

#include <limits>
#include <sstream>

#include "ros/conversions/poses.h"
#include "ros/node/parameters.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

constexpr double kRadPerDeg = 0.017453292519943295;
/// A day: longer times could not be added to a stamp.
constexpr double kLongestS = 86400.0;
constexpr double kLongestSweepS = 60.0;
constexpr int kMostTracked = 1000;

void read_frame(Parameters& parameters, FixedFrameOptions& frame) {
  frame.frame = parameters.frame("fixed_frame", frame.frame);
  frame.max_tf_age_s = parameters.number("max_tf_age", frame.max_tf_age_s, 0.0);
  frame.jump_window_s = parameters.number("jump_window", frame.jump_window_s, 0.0, kLongestS);
  frame.max_jump_mm = parameters.number("max_jump_mm", frame.max_jump_mm, 0.0);
  frame.max_jump_deg = parameters.number("max_jump_deg", frame.max_jump_deg, 0.0);
  frame.max_sweep_motion_mm =
      parameters.number("max_sweep_motion_mm", frame.max_sweep_motion_mm, 0.0);
  frame.sweep_duration_s =
      parameters.number("sweep_duration", frame.sweep_duration_s, 0.0, kLongestSweepS);
}

std::vector<double> three_numbers(Parameters& parameters, const std::string& key) {
  const std::vector<double> numbers = parameters.numbers(key, 3);
  return numbers.empty() ? std::vector<double>(3, 0.0) : numbers;
}

/// The angles are rotations about the fixed axes x, y, z, in this order.
std::optional<FramedAlignment> read_initial_alignment(Parameters& parameters,
                                                      const ::ros::NodeHandle& node) {
  const std::string frame = parameters.frame("initial_alignment/frame", "");
  const std::vector<double> t_m = three_numbers(parameters, "initial_alignment/translation");
  const std::vector<double> r_deg = three_numbers(parameters, "initial_alignment/rotation_deg");
  if (frame.empty()) {
    if (t_m != std::vector<double>(3, 0.0) || r_deg != std::vector<double>(3, 0.0))
      throw InputError(node.resolveName("initial_alignment/frame"),
                       "is empty, must be set with a translation or rotation_deg");
    return std::nullopt;
  }
  FramedAlignment alignment;
  alignment.frame = frame;
  alignment.T_frame_ct.translation() = kMmPerM * Eigen::Vector3d(t_m[0], t_m[1], t_m[2]);
  alignment.T_frame_ct.linear() =
      (Eigen::AngleAxisd(kRadPerDeg * r_deg[2], Eigen::Vector3d::UnitZ()) *
       Eigen::AngleAxisd(kRadPerDeg * r_deg[1], Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(kRadPerDeg * r_deg[0], Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return alignment;
}

ProbeDirection read_probe_direction(Parameters& parameters, const ::ros::NodeHandle& node) {
  std::istringstream text(parameters.text("probe_direction", "posterior left"));
  std::vector<std::string> words;
  for (std::string word; text >> word;) words.push_back(word);
  return parse_probe_direction(words, node.resolveName("probe_direction"));
}

void read_registrar(Parameters& parameters, const ::ros::NodeHandle& node,
                    RegistrarOptions& registrar) {
  registrar.preset = parameters.text("preset", registrar.preset);
  registrar.options = parameters.text("options", registrar.options);
  const int seed = parameters.whole("seed", -1, -1);
  if (seed >= 0) registrar.seed = static_cast<std::uint32_t>(seed);
  registrar.allow_older_ultrasound = parameters.flag("allow_older_ultrasound", false);
  registrar.full_every =
      parameters.whole("full_registration_every", registrar.full_every, 1, kMostTracked);
  registrar.allow_global = parameters.flag("allow_global", false);
  registrar.probe_direction = read_probe_direction(parameters, node);
}

}  // namespace

RegistrationParameters read_registration_parameters(const ::ros::NodeHandle& private_node) {
  constexpr int kMostVolumes = 100;
  constexpr int kMostThreads = 1024;
  Parameters parameters(private_node);
  RegistrationParameters all;
  read_frame(parameters, all.frame);
  read_registrar(parameters, private_node, all.registrar);
  all.initial_alignment = read_initial_alignment(parameters, private_node);
  all.volumes.ultrasound_volumes =
      parameters.whole("volumes_kept", all.volumes.ultrasound_volumes, 1, kMostVolumes);
  all.volumes.tf_timeout_s =
      parameters.number("tf_timeout", all.volumes.tf_timeout_s, 0.0, kLongestS);
  all.tf_history_s = parameters.number("tf_history", all.tf_history_s, 1.0, kLongestS);
  all.max_tf_gap_s = parameters.number("max_tf_gap", all.max_tf_gap_s, 0.0, kLongestS);
  all.threads = parameters.whole("threads", all.threads, 0, kMostThreads);
  all.continuous = parameters.flag("continuous", all.continuous);
  all.diagnostic_period_s = read_diagnostic_period(parameters);
  all.source = private_node.resolveName(all.registrar.options.empty() ? "preset" : "options");
  parameters.finish();
  return all;
}

}  // namespace usct::ros_interface
