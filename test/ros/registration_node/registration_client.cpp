#include "registration_client.h"

#include <array>
#include <cstdio>

namespace usct::ros_interface {

std_msgs::Header header(const std::string& frame, const ::ros::Time& stamp) {
  std_msgs::Header header;
  header.frame_id = frame;
  header.stamp = stamp;
  return header;
}

msg::PreScanVolume agar_ultrasound(const ::ros::Time& stamp, const std::string& frame) {
  static const msg::PreScanVolume message =
      to_message(test::agar_phantom().ultrasound, header("us", ::ros::Time(1.0)));
  msg::PreScanVolume copy = message;
  copy.header = header(frame, stamp);
  return copy;
}

tf2_msgs::TFMessage tf_of_us(const ::ros::Time& stamp, const Eigen::Isometry3d& T_patient_us,
                             const std::string& us_frame) {
  tf2_msgs::TFMessage message;
  message.transforms.resize(1);
  message.transforms[0].header = header("patient", stamp);
  message.transforms[0].child_frame_id = us_frame;
  message.transforms[0].transform = to_message(T_patient_us);
  return message;
}

MovingSweep moving_sweep(const Eigen::Isometry3d& T_patient_us, double share, double drift_mm,
                         const std::string& us_frame) {
  constexpr double kPeriodS = 0.1;
  const ::ros::Time end = ::ros::Time::now();
  MovingSweep moving{agar_ultrasound(end, us_frame), {}};
  msg::PreScanVolume& sweep = moving.sweep;
  const double probe_mm = kMmPerM * sweep.geometry.probe_radius;
  const double motor_mm = kMmPerM * sweep.geometry.motor_radius;
  const std::size_t last = sweep.frame_angles.size() - 1;
  const auto know = [&](const ::ros::Time& stamp, const Eigen::Isometry3d& T) {
    moving.poses.transforms.push_back(tf_of_us(stamp, T, us_frame).transforms[0]);
  };
  for (std::size_t i = 0; i <= last; ++i) {
    const double moved_rad = share * sweep.frame_angles[i];
    const ::ros::Time stamp = end - ::ros::Duration(kPeriodS * static_cast<double>(last - i));
    const double way_mm = drift_mm * static_cast<double>(i) / static_cast<double>(last);
    const Eigen::Isometry3d T = T_patient_us * Eigen::Translation3d(way_mm, 0.0, 0.0) *
                                T_us_frame_at_motor_angle(probe_mm, motor_mm, moved_rad);
    sweep.frame_stamps.push_back(stamp);
    sweep.frame_angles[i] -= moved_rad;
    know(stamp, T);
    if (i == last) know(end + ::ros::Duration(0.5), T);
  }
  return moving;
}

bool is_zero(const geometry_msgs::Transform& transform) {
  const auto& t = transform.translation;
  const auto& r = transform.rotation;
  return t.x == 0.0 && t.y == 0.0 && t.z == 0.0 && r.x == 0.0 && r.y == 0.0 && r.z == 0.0 &&
         r.w == 0.0;
}

Result result_of(const Client& action) {
  const msg::RegisterResultConstPtr result = action.getResult();
  EXPECT_NE(result, nullptr) << "the goal ended as " << action.getState().toString();
  return result ? result->result : Result();
}

Result goal_result(RegistrationClient& client, const msg::RegisterGoal& goal) {
  EXPECT_TRUE(client.action.waitForServer(kLimit));
  client.action.sendGoal(goal);
  EXPECT_TRUE(client.action.waitForResult(kLimit));
  return result_of(client.action);
}

void provide_agar(RegistrationClient& client, unsigned revision) {
  const ::ros::Time now = ::ros::Time::now();
  client.send_ct(agar().ct, revision, now - ::ros::Duration(1.0));
  client.send(agar_ultrasound(now));
  ASSERT_TRUE(
      eventually([&] { return client.set(test::nearby(agar()), "us").status.code == Status::OK; }));
  // The refusal of a goal names the volumes that the node holds.
  ASSERT_TRUE(eventually([&] {
    msg::RegisterGoal goal;
    goal.us_stamp = now;
    goal.use_initial = true;
    goal.initial.header.frame_id = "nowhere";
    goal.initial.transform.rotation.w = 1.0;
    const Result result = goal_result(client, goal);
    return result.us_stamp == now && result.ct_revision == revision;
  }));
}

double error_mm(const Result& result) {
  return agar().error_mm(from_message_mm(result.transform, "result"));
}

std::string output_of(const std::string& command) {
  std::string output;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return output;
  std::array<char, 4096> text{};
  while (fgets(text.data(), static_cast<int>(text.size()), pipe) != nullptr) output += text.data();
  output += "\nexit status " + std::to_string(WEXITSTATUS(pclose(pipe)));
  return output;
}

}  // namespace usct::ros_interface
