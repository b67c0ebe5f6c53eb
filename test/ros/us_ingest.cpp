#include <diagnostic_msgs/DiagnosticArray.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sys/wait.h>
#include <tf2_msgs/TFMessage.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>

#include "core/io/temporary_folder.h"
#include "core/ultrasound/lagging_sweep.h"
#include "ros/conversions.h"
#include "ros/frames.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kLimit_s = 60.0;

bool wait_for(const std::function<bool()>& condition) {
  const ::ros::WallTime end = ::ros::WallTime::now() + ::ros::WallDuration(kLimit_s);
  while (!condition()) {
    if (::ros::WallTime::now() > end || !::ros::ok()) return false;
    ::ros::WallDuration(0.01).sleep();
  }
  return true;
}

/// The messages of a topic, as they come.
template <typename Message>
class Inbox {
 public:
  Inbox(::ros::NodeHandle& node, const std::string& topic)
      : subscriber_(
            node.subscribe<Message>(topic, 100, [this](const typename Message::ConstPtr& m) {
              const std::lock_guard<std::mutex> lock(mutex_);
              messages_.push_back(m);
            })) {}

  std::vector<typename Message::ConstPtr> all() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  bool wait(std::size_t count) const {
    return wait_for([&] { return all().size() >= count; });
  }
  /// Of two messages that are sent before this, only the last may come: latched.
  bool wait_for_publisher() const {
    return wait_for([&] { return subscriber_.getNumPublishers() > 0; });
  }

 private:
  mutable std::mutex mutex_;
  std::vector<typename Message::ConstPtr> messages_;
  ::ros::Subscriber subscriber_;  // last: its callback uses the others
};

/// Whether diagnostics show `text` in a status of `node` with this level.
bool wait_for_diagnostics(const Inbox<diagnostic_msgs::DiagnosticArray>& inbox,
                          const std::string& node, int level, const std::string& text) {
  return wait_for([&] {
    for (const auto& message : inbox.all())
      for (const auto& status : message->status)
        if (status.name.find(node) != std::string::npos && status.level == level &&
            status.message.find(text) != std::string::npos)
          return true;
    return false;
  });
}

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
        tf_(node_.advertise<tf2_msgs::TFMessage>("/tf", 1000)) {
    EXPECT_TRUE(wait_for([&] { return frames_.getNumSubscribers() == 1; }));
    EXPECT_TRUE(volumes_.wait_for_publisher());
    // A volume of an earlier test is latched and comes first.
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
  ::ros::Publisher tf_;
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

TEST_P(Streaming, TrackedFramesGetTheirPosesFromTfThatComesLater) {
  constexpr int kFrames = 10;
  constexpr double kPeriod_s = 0.05;
  EXPECT_TRUE(wait_for([&] { return tf_.getNumSubscribers() >= 2; }));
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
  // A steady motion of 2 m/s along y, seen between the frames: what is asked for is interpolated.
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

/// A node of its own, interrupted with the end of the test.
class Process {
 public:
  explicit Process(const std::vector<std::string>& arguments) {
    // Test programs and nodes lie in the same folder.
    std::string program = fs::read_symlink("/proc/self/exe").parent_path() / "us_ingest";
    std::vector<std::string> texts(arguments);
    std::vector<char*> argv{program.data()};
    for (std::string& text : texts) argv.push_back(text.data());
    argv.push_back(nullptr);
    std::array<int, 2> ends{};
    if (::pipe(ends.data()) != 0) throw std::runtime_error("no pipe");
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(ends[1], STDOUT_FILENO);
      ::dup2(ends[1], STDERR_FILENO);
      ::close(ends[0]);
      ::execv(program.c_str(), argv.data());
      ::_exit(127);
    }
    ::close(ends[1]);
    output_ = ::fdopen(ends[0], "r");
  }
  ~Process() {
    if (pid_ > 0) {
      ::kill(pid_, SIGINT);
      ::waitpid(pid_, nullptr, 0);
    }
    std::fclose(output_);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// What it says until it ends by itself, and its exit status.
  std::pair<std::string, int> end() {
    std::string output;
    std::array<char, 256> part{};
    while (std::fgets(part.data(), static_cast<int>(part.size()), output_) != nullptr)
      output += part.data();
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
    return {output, WEXITSTATUS(status)};
  }

 private:
  pid_t pid_ = -1;
  FILE* output_ = nullptr;
};

TEST(Parameters, AnUnknownKeyEndsTheNodeAndIsNamed) {
  const auto [output, status] = Process({"__name:=misspelt", "_swep_pause:=1.0"}).end();
  EXPECT_EQ(status, 2);
  EXPECT_THAT(output, HasSubstr("/misspelt/swep_pause"));
}

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(Folder, TakesWholeFilesNamesBadOnesAndGoesOn) {
  const test::TemporaryFolder folder;
  const test::TemporaryFolder elsewhere;
  PreScanVolume volume;
  volume.geometry = {
      {2, 1.0, 0.5}, CurvilinearArray{40.0, {-0.1, 0.1}}, MotorSweep{27.0, {0.0, 0.1}, 0.0}};
  volume.voxels = {1, 2, 3, 4, 5, 6, 7, 8};
  volume.acquisition_time = "2024-05-17T09:30:00Z";
  write_prescan_nrrd(volume, elsewhere.path() / "us.nrrd");
  const std::string bytes = bytes_of(elsewhere.path() / "us.nrrd");

  ::ros::NodeHandle node;
  const Inbox<msg::PreScanVolume> volumes(node, "/watching/us/volume");
  const Inbox<diagnostic_msgs::DiagnosticArray> diagnostics(node, "/diagnostics");
  const Process process({"__ns:=watching", "_source:=folder", "_path:=" + folder.path().string(),
                         "_folder_period:=0.05", "_folder_settle:=2.0"});
  ASSERT_TRUE(wait_for_diagnostics(diagnostics, "watching", diagnostic_msgs::DiagnosticStatus::OK,
                                   "waiting"));
  // Half of a file, at which the node looks many times until it next reports, then the rest.
  std::ofstream half(folder.path() / "half.nrrd", std::ios::binary);
  half << bytes.substr(0, bytes.size() / 2) << std::flush;
  const std::size_t reports = diagnostics.all().size();
  ASSERT_TRUE(wait_for([&] { return diagnostics.all().size() >= reports + 3; }));
  half << bytes.substr(bytes.size() / 2);
  half.close();
  ASSERT_TRUE(volumes.wait(1));
  EXPECT_EQ(from_message(*volumes.all()[0], "volume").voxels, volume.voxels);
  EXPECT_EQ(volumes.all()[0]->header.stamp, ::ros::Time(1715938200, 0));
  EXPECT_EQ(volumes.all()[0]->header.frame_id, "us");

  std::ofstream(folder.path() / "bad.nrrd", std::ios::binary) << bytes.substr(0, bytes.size() / 2);
  EXPECT_TRUE(wait_for_diagnostics(diagnostics, "watching",
                                   diagnostic_msgs::DiagnosticStatus::ERROR, "bad.nrrd"));
  volume.voxels[0] = 99;
  write_prescan_nrrd(volume, folder.path() / "next.nrrd");
  ASSERT_TRUE(volumes.wait(2));
  EXPECT_EQ(volumes.all()[1]->data[0], 99);
  EXPECT_EQ(volumes.all().size(), 2u);
}

TEST(File, IsPublishedForWhoeverComesLater) {
  const test::TemporaryFolder folder;
  test::SweepCase how;
  how.along_mm = test::unsteady_mm;
  how.duration_s = 1.0;
  const PreScanVolume volume = test::sweep_of(how, 2);
  write_prescan_nrrd(volume, folder.path() / "us.nrrd");
  ::ros::NodeHandle node;
  const Inbox<diagnostic_msgs::DiagnosticArray> diagnostics(node, "/diagnostics");
  const Process process({"__ns:=reading", "_source:=file", "_frame_id:=patient",
                         "_file_stamp:=reading", "_path:=" + (folder.path() / "us.nrrd").string()});
  ASSERT_TRUE(wait_for_diagnostics(diagnostics, "reading", diagnostic_msgs::DiagnosticStatus::OK,
                                   "published"));
  const Inbox<msg::PreScanVolume> volumes(node, "/reading/us/volume");
  ASSERT_TRUE(volumes.wait(1));
  EXPECT_EQ(volumes.all()[0]->data, volume.voxels);
  EXPECT_EQ(volumes.all()[0]->header.frame_id, "patient");
}

TEST(File, OneThatIsMissingEndsTheNodeAndIsNamed) {
  const auto [output, status] =
      Process({"__name:=no_file", "_source:=file", "_path:=/no/such.nrrd"}).end();
  EXPECT_EQ(status, 2);
  EXPECT_THAT(output, HasSubstr("/no/such.nrrd"));
}

}  // namespace
}  // namespace usct::ros_interface

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_us_ingest");
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
