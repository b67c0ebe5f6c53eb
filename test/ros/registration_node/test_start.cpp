#include <std_msgs/String.h>

#include <cstdlib>
#include <filesystem>

#include "registration_client.h"
#include "ros/registration_node.h"

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
