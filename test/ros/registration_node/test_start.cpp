#include <std_msgs/String.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "registration_client.h"
#include "ros/registration/registration_node.h"
#include "ros/registration/registration_parameters.h"

namespace usct::ros_interface {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(Registration, WrongParametersEndTheNodeNamingThem) {
  const auto started_with = [](const std::string& parameters) {
    const auto node =
        std::filesystem::read_symlink("/proc/self/exe").parent_path() / "registration";
    return output_of(node.string() + " __name:=wrong " + parameters);
  };
  EXPECT_THAT(started_with("_options:='search: {levels: {0: {spacing: 3}}}'"),
              AllOf(HasSubstr("/wrong/options"), HasSubstr("search.levels[0].spacing"),
                    HasSubstr("exit status 2")));
  EXPECT_EQ(std::system("rosparam delete /wrong"), 0);
  EXPECT_THAT(started_with("_preset:=fastest"),
              AllOf(HasSubstr("fastest"), HasSubstr("exit status 2")));
  EXPECT_EQ(std::system("rosparam delete /wrong"), 0);
  EXPECT_THAT(started_with("_initial_alignment/rotation:='[0, 0, 90]'"),
              AllOf(HasSubstr("/wrong/initial_alignment/rotation"), HasSubstr("exit status 2")));
  EXPECT_EQ(std::system("rosparam delete /wrong"), 0);
  EXPECT_THAT(started_with("_max_tf_agee:=1.0"),
              AllOf(HasSubstr("/wrong/max_tf_agee"), HasSubstr("exit status 2")));
}

TEST(Registration, EachParameterIsUsed) {
  const ::ros::NodeHandle node("each_parameter");
  const std::map<std::string, double> numbers = {
      {"max_tf_age", 0.25},      {"jump_window", 0.3},         {"max_jump_mm", 4.5},
      {"max_jump_deg", 5.5},     {"max_sweep_motion_mm", 6.5}, {"sweep_duration", 7.5},
      {"tf_timeout", 8.5},       {"tf_history", 95.0},         {"max_tf_gap", 1.5},
      {"diagnostic_period", 0.5}};
  for (const auto& [name, value] : numbers) node.setParam(name, value);
  for (const auto& [name, value] : std::map<std::string, int>{
           {"seed", 17}, {"volumes_kept", 3}, {"threads", 2}, {"full_registration_every", 9}})
    node.setParam(name, value);
  for (const char* flag : {"allow_older_ultrasound", "allow_global", "continuous"})
    node.setParam(flag, true);
  node.setParam("fixed_frame", "patient");
  node.setParam("preset", "fast");
  node.setParam("options", "search: {rounds: 2}");
  node.setParam("initial_alignment/frame", "table");
  node.setParam("initial_alignment/translation", std::vector<double>{0.1, 0.2, 0.3});
  node.setParam("initial_alignment/rotation_deg", std::vector<double>{30.0, 0.0, 90.0});
  const RegistrationParameters read = read_registration_parameters(node);
  const std::map<std::string, double> found = {
      {"max_tf_age", read.frame.max_tf_age_s},
      {"jump_window", read.frame.jump_window_s},
      {"max_jump_mm", read.frame.max_jump_mm},
      {"max_jump_deg", read.frame.max_jump_deg},
      {"max_sweep_motion_mm", read.frame.max_sweep_motion_mm},
      {"sweep_duration", read.frame.sweep_duration_s},
      {"tf_timeout", read.volumes.tf_timeout_s},
      {"tf_history", read.tf_history_s},
      {"max_tf_gap", read.max_tf_gap_s},
      {"diagnostic_period", read.diagnostic_period_s}};
  EXPECT_EQ(found, numbers);
  EXPECT_EQ(read.registrar.seed, 17U);
  EXPECT_EQ(read.volumes.ultrasound_volumes, 3);
  EXPECT_EQ(read.threads, 2);
  EXPECT_EQ(read.registrar.full_every, 9);
  EXPECT_TRUE(read.registrar.allow_older_ultrasound);
  EXPECT_TRUE(read.registrar.allow_global);
  EXPECT_TRUE(read.continuous);
  EXPECT_EQ(read.frame.frame, "patient");
  EXPECT_EQ(read.registrar.preset, "fast");
  EXPECT_EQ(read.registrar.options, "search: {rounds: 2}");
  // The rotations are about the fixed axes: first about x, by which y turns towards z.
  ASSERT_TRUE(read.initial_alignment);
  EXPECT_EQ(read.initial_alignment->frame, "table");
  const Eigen::Isometry3d& T = read.initial_alignment->T_frame_ct;
  EXPECT_TRUE(T.translation().isApprox(Eigen::Vector3d(100.0, 200.0, 300.0), 1e-12));
  EXPECT_TRUE((T.linear() * Eigen::Vector3d::UnitY())
                  .isApprox(Eigen::Vector3d(-std::sqrt(0.75), 0.0, 0.5), 1e-9));
}

void ignore(const std_msgs::String::ConstPtr&) {}

/// A node that cannot start must not end others of the same nodelet manager. Here another
/// subscriber of the process has the node's topic with another type, which shows only late in the
/// constructor.
TEST(Registration, ANodeThatCannotStartEndsWithAnException) {
  ::ros::NodeHandle node("conflict");
  const ::ros::Subscriber other = node.subscribe("us/volume", 1, ignore);
  const ::ros::NodeHandle private_node("conflict/registration");
  EXPECT_THROW(RegistrationNode(node, private_node), ::ros::ConflictingSubscriptionException);
}

}  // namespace
}  // namespace usct::ros_interface
