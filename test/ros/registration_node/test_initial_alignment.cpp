#include "registration_client.h"
#include "us_ct_registration/registration/rough_pose.h"

namespace usct::ros_interface {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using testing::HasSubstr;

TEST(Registration, NoInitialAlignmentIsRefused) {
  RegistrationClient client("plain");
  provide_agar(client, 7);
  msg::SetInitialAlignment clear;
  clear.request.type = msg::SetInitialAlignment::Request::CLEAR;
  ASSERT_TRUE(client.set_service.call(clear));
  EXPECT_EQ(clear.response.status.code, Status::OK);
  EXPECT_THAT(client.call_until_code(Status::NO_INITIAL_ALIGNMENT).status.message,
              HasSubstr("allow_global is false"));
}

/// The CT is rotated so that the probe's direction, all that the node knows, is 20 degrees off.
TEST(Registration, GlobalSearchIfAllowed) {
  RegistrationClient client("anywhere");
  const Isometry3d rough = rough_pose(agar().ct.grid, agar().us.beams, ProbeDirection{});
  Isometry3d turn = test::rigid({0.2, -0.2, 0.2}, {0, 0, 0});
  turn.linear() *= rough.linear().transpose() * agar().T_us_ct_true.linear();
  const test::RegistrationCase turned = test::moved(agar(), Isometry3d::Identity(), turn);
  client.send_ct(turned.ct, 1, ::ros::Time::now() - ::ros::Duration(20.0));
  client.send(agar_ultrasound(::ros::Time::now()));
  const Result result = client.call_until_code(Status::REGISTERED);
  EXPECT_EQ(result.initial_alignment, "global");
  EXPECT_EQ(result.preset, "global");
  EXPECT_LT(turned.error_mm(from_message_mm(result.transform, "result")), kGoodMm);
  // A gate that a goal asks for holds here too.
  msg::RegisterGoal goal;
  goal.options = "confidence: {gates: {max_wrong_probability: 0}}";
  const Result gated = goal_result(client, goal);
  EXPECT_EQ(gated.status.code, Status::LOW_CONFIDENCE) << gated.status.message;
  EXPECT_EQ(gated.preset, "global with options");
}

TEST(Registration, LandmarksAreAnInitialAlignment) {
  RegistrationClient client("plain");
  provide_agar(client, 8);
  msg::SetInitialAlignment set;
  set.request.type = msg::SetInitialAlignment::Request::LANDMARKS;
  set.request.header.frame_id = "us";
  const Isometry3d T_ct_us = test::nearby(agar()).inverse();
  for (std::size_t i = 0; i < 200; i += 40) {
    const Vector3d p = agar().targets_us_mm.at(i);
    set.request.points.push_back(to_message(p));
    set.request.points_ct.push_back(to_message(Vector3d(T_ct_us * p)));
  }
  ASSERT_TRUE(client.set_service.call(set));
  EXPECT_EQ(set.response.status.code, Status::OK) << set.response.status.message;
  EXPECT_NEAR(set.response.residual, 0.0, 1e-9);
  EXPECT_LT(error_mm(client.call_until_code(Status::REGISTERED)), kGoodMm);
  set.request.points.resize(2);
  set.request.points_ct.resize(2);
  ASSERT_TRUE(client.set_service.call(set));
  EXPECT_EQ(set.response.status.code, Status::INVALID_REQUEST);
}

}  // namespace
}  // namespace usct::ros_interface
