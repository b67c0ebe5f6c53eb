#include <gtest/gtest.h>
#include <us_ct_registration/Acquisition.h>

#include <map>
#include <random>

#include "core/ultrasound/lagging_sweep.h"
#include "inbox.h"
#include "ros/bags/frame_stream.h"
#include "ros/conversions/ultrasound.h"
#include "ros/tf_source.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

msg::PreScanVolume stamped(PreScanVolume volume, const ::ros::Time& end, double period_s) {
  std_msgs::Header header;
  header.frame_id = "us";
  header.stamp = end;
  msg::PreScanVolume message = to_message(volume, header);
  message.frame_stamps.clear();
  for (int i = volume.geometry.frames() - 1; i >= 0; --i)
    message.frame_stamps.push_back(end - ::ros::Duration(i * period_s));
  return message;
}

msg::PreScanVolume motorised(const ::ros::Time& end, double direction) {
  PreScanVolume volume;
  MotorSweep sweep{27.25, {}, 0.011 * direction};
  for (int i = 0; i < 12; ++i) sweep.frame_angles_rad.push_back(direction * (0.0213 * i - 0.1));
  volume.geometry = {{20, 3.1, 0.37}, CurvilinearArray{40.3, {-0.1, 0.03, 0.1}}, sweep};
  std::mt19937 random(5);
  for (int i = 0; i < 12 * 3 * 20; ++i)
    volume.voxels.push_back(static_cast<std::uint8_t>(random()));
  return stamped(volume, end, 0.05);
}

class Streaming : public testing::TestWithParam<const char*> {
 protected:
  Streaming()
      : space_(GetParam()),
        volumes_(node_, space_ + "/us/volume"),
        diagnostics_(node_, "/diagnostics"),
        frames_(node_.advertise<msg::PreScanFrame>(space_ + "/us/frames", 1000)),
        tf_(node_, {"/" + space_ + (space_ == "as_nodelet" ? "/manager" : "/us_ingest")}) {
    EXPECT_TRUE(eventually([&] { return frames_.getNumSubscribers() == 1; }));
    EXPECT_TRUE(volumes_.wait_for_publisher());
    // A volume of an earlier test is latched and arrives first.
    const int earlier = streamed[space_] > 0 ? 1 : 0;
    EXPECT_TRUE(volumes_.wait(static_cast<std::size_t>(earlier)));
    first_ = volumes_.all().size();
  }

  void send(const std::vector<msg::PreScanFrame>& frames) {
    for (const msg::PreScanFrame& frame : frames) frames_.publish(frame);
  }
  FrameStream next_sweep() {
    FrameStream stream;
    stream.sweep = static_cast<std::uint32_t>(streamed[space_]++);
    return stream;
  }
  /// The n-th volume that this test caused.
  msg::PreScanVolume volume(std::size_t n) {
    EXPECT_TRUE(volumes_.wait(first_ + n + 1));
    if (volumes_.all().size() < first_ + n + 1) return {};
    msg::PreScanVolume found = *volumes_.all()[first_ + n];
    found.header.seq = 0;  // counted by the publisher
    return found;
  }

  static std::map<std::string, int> streamed;
  ::ros::NodeHandle node_;
  std::string space_;
  Inbox<msg::PreScanVolume> volumes_;
  Inbox<diagnostic_msgs::DiagnosticArray> diagnostics_;
  ::ros::Publisher frames_;
  TfSource tf_;
  std::size_t first_ = 0;
};

std::map<std::string, int> Streaming::streamed;

TEST_P(Streaming, TwoMotorisedSweepsInARowArriveBitByBit) {
  const ::ros::Time now = ::ros::Time::now();
  const msg::PreScanVolume forth = motorised(now - ::ros::Duration(1.0), 1.0);
  const msg::PreScanVolume back = motorised(now, -1.0);
  send(frames_of(forth, next_sweep()));
  send(frames_of(back, next_sweep()));
  EXPECT_EQ(volume(0), forth);
  EXPECT_EQ(volume(1), back);
  EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, diagnostic_msgs::DiagnosticStatus::OK,
                                   "published"));
}

/// So that nobody who asks for the newest sweep gets the one before.
TEST_P(Streaming, ASweepIsAnnouncedFromItsFirstFrameOnAndWhenItIsRefused) {
  const Inbox<msg::Acquisition> announced(node_, space_ + "/us/announced");
  const auto is_last = [&](std::uint8_t state, const ::ros::Time& stamp) {
    const auto all = announced.all();
    return !all.empty() && all.back()->state == state && all.back()->header.stamp == stamp;
  };
  const msg::PreScanVolume sweep = motorised(::ros::Time::now(), 1.0);
  std::vector<msg::PreScanFrame> frames = frames_of(sweep, next_sweep());
  send({frames.begin(), frames.begin() + 3});
  EXPECT_TRUE(
      eventually([&] { return is_last(msg::Acquisition::RECORDING, sweep.frame_stamps.front()); }));
  send({frames.begin() + 3, frames.end()});
  EXPECT_TRUE(eventually([&] { return is_last(msg::Acquisition::RECORDED, sweep.header.stamp); }));
  EXPECT_EQ(volume(0), sweep);

  const msg::PreScanVolume torn = motorised(::ros::Time::now(), 1.0);
  frames = frames_of(torn, next_sweep());
  frames.erase(frames.begin() + 4, frames.begin() + 8);
  send(frames);  // it ends by a pause
  EXPECT_TRUE(eventually([&] { return is_last(msg::Acquisition::REFUSED, torn.header.stamp); }));
  EXPECT_NE(announced.all().back()->reason.find("4 of 12 frames are missing"), std::string::npos)
      << announced.all().back()->reason;
}

/// Each of these once ended the node, which is `required`.
TEST_P(Streaming, FramesWithStampsFarFromNowAreDropped) {
  for (const std::uint32_t seconds : {4294967200U, 4294967295U}) {
    std::vector<msg::PreScanFrame> frames =
        frames_of(motorised(::ros::Time::now(), 1.0), next_sweep());
    for (msg::PreScanFrame& frame : frames) frame.header.stamp = ::ros::Time(seconds, 0);
    send(frames);
    tf2_msgs::TFMessage message;
    message.transforms.resize(1);
    message.transforms[0].header = frames.front().header;
    message.transforms[0].header.frame_id = "patient";
    message.transforms[0].child_frame_id = "array_far";
    message.transforms[0].transform.rotation.w = 1.0;
    tf_.publish(message);
  }
  const msg::PreScanVolume sweep = motorised(::ros::Time::now(), 1.0);
  send(frames_of(sweep, next_sweep()));
  EXPECT_EQ(volume(0), sweep);
  EXPECT_TRUE(eventually([&] {
    for (const auto& message : diagnostics_.all())
      for (const auto& status : message->status)
        for (const auto& value : status.values)
          if (status.name.find(space_) != std::string::npos && value.key == "last problem" &&
              value.value.find("ahead of this node's clock") != std::string::npos)
            return true;
    return false;
  }));
}

TEST_P(Streaming, TrackedFramesGetTheirPosesFromTfThatComesLater) {
  constexpr int kFrames = 10;
  constexpr double kPeriod_s = 0.05;
  PreScanVolume still;
  still.geometry = {
      {20, 0.0, 0.5},
      LinearArray{{-1.0, 0.0, 1.0}},
      TrackedSweep{std::vector<Eigen::Isometry3d>(kFrames, Eigen::Isometry3d::Identity()), {}}};
  for (int i = 0; i < kFrames * 60; ++i) still.voxels.push_back(static_cast<std::uint8_t>(i % 251));
  const ::ros::Time end = ::ros::Time::now();
  FrameStream stream = next_sweep();
  stream.array_frame_id = "array_of_" + space_;
  std::vector<msg::PreScanFrame> frames = frames_of(stamped(still, end, kPeriod_s), stream);
  for (msg::PreScanFrame& frame : frames) {
    frame.pose_frame_id.clear();
    frame.pose = geometry_msgs::Pose();
  }
  send(frames);
  // The motion is a steady 2 m/s along y, with poses between the frames, so that tf interpolates.
  for (int i = -1; i <= kFrames; ++i) {
    tf2_msgs::TFMessage message;
    message.transforms.resize(1);
    geometry_msgs::TransformStamped& T = message.transforms[0];
    const double before_end_s = (kFrames - 1 - i - 0.3) * kPeriod_s;
    T.header.stamp = end - ::ros::Duration(before_end_s);
    T.header.frame_id = "patient";
    T.child_frame_id = stream.array_frame_id;
    T.transform.translation.y = -2.0 * before_end_s;
    T.transform.rotation.w = 1.0;
    tf_.publish(message);
  }
  const msg::PreScanVolume found = volume(0);
  EXPECT_EQ(found.header.frame_id, "patient");
  EXPECT_EQ(found.header.stamp, end);
  ASSERT_EQ(found.frame_poses.size(), static_cast<std::size_t>(kFrames));
  for (int i = 0; i < kFrames; ++i)
    EXPECT_NEAR(found.frame_poses[static_cast<std::size_t>(i)].position.y,
                -2.0 * (kFrames - 1 - i) * kPeriod_s, 1e-6);
}

TEST_P(Streaming, ALagThatNobodyToldOfIsAWarning) {
  test::SweepCase how;
  how.lag_s = 0.5;
  how.along_mm = test::unsteady_mm;
  std_msgs::Header header;
  header.frame_id = "patient";
  header.stamp = ::ros::Time::now();
  const msg::PreScanVolume lagging = to_message(test::sweep_of(how, 9), header);
  send(frames_of(lagging, next_sweep()));
  EXPECT_EQ(volume(0), lagging);
  EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, diagnostic_msgs::DiagnosticStatus::WARN,
                                   "images lag poses by 0."));
}

INSTANTIATE_TEST_SUITE_P(UsIngest, Streaming, testing::Values("as_node", "as_nodelet"));

}  // namespace
}  // namespace usct::ros_interface
