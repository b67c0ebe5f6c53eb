#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <us_ct_registration/PreScanVolume.h>

#include "clock.h"
#include "core/io/temporary_folder.h"
#include "core/ultrasound/lagging_sweep.h"
#include "ros/process.h"
#include "ros/us_ingest/inbox.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;

/// A node that publishes a file with the time of reading, started before the time begins. The
/// sweep of the file took a second.
class FilesBeforeTimeBegins : public testing::Test {
 protected:
  FilesBeforeTimeBegins() : clock_(node_), diagnostics_(node_, "/diagnostics") {
    test::SweepCase how;
    how.along_mm = test::unsteady_mm;
    how.duration_s = 1.0;
    write_prescan_nrrd(test::sweep_of(how, 2), file_);
  }

  static std::vector<std::string> with_parameters(const std::string& space,
                                                  const std::vector<std::string>& parameters) {
    std::vector<std::string> arguments{"__ns:=" + space, "_file_stamp:=reading",
                                       "_diagnostic_period:=0.05"};
    arguments.insert(arguments.end(), parameters.begin(), parameters.end());
    return arguments;
  }

  void expect_a_volume_once_time_has_begun(const std::string& space,
                                           const std::vector<std::string>& parameters) {
    const Process process("us_ingest", with_parameters(space, parameters));
    const Inbox<msg::PreScanVolume> volumes(node_, space + "/us/volume");
    ASSERT_TRUE(wait_for_diagnostics(diagnostics_, space, DiagnosticStatus::WARN, "/clock"));
    ASSERT_TRUE(volumes.wait_for_publisher());
    EXPECT_TRUE(volumes.all().empty());
    clock_.set(::ros::Time(1000.0));
    ASSERT_TRUE(volumes.wait(1));
    EXPECT_EQ(volumes.all()[0]->header.stamp, ::ros::Time(1000.0));
    EXPECT_TRUE(
        wait_for_diagnostics(diagnostics_, space, DiagnosticStatus::OK, "volumes published"));
  }

  /// Simulators begin at 0, where the first frames of the sweep would lie before it.
  void expect_a_volume_once_all_frames_are_past(const std::string& space,
                                                const std::vector<std::string>& parameters) {
    const Process process("us_ingest", with_parameters(space, parameters));
    const Inbox<msg::PreScanVolume> volumes(node_, space + "/us/volume");
    clock_.set(::ros::Time(0.5));
    ASSERT_TRUE(wait_for_diagnostics(diagnostics_, space, DiagnosticStatus::WARN, "at 0.500 s"));
    EXPECT_TRUE(volumes.all().empty());
    clock_.set(::ros::Time(2.0));
    ASSERT_TRUE(volumes.wait(1));
    EXPECT_EQ(volumes.all()[0]->header.stamp, ::ros::Time(2.0));
    EXPECT_TRUE(
        wait_for_diagnostics(diagnostics_, space, DiagnosticStatus::OK, "volumes published"));
  }

  std::vector<std::string> of_file() const { return {"_source:=file", "_path:=" + file_.string()}; }
  std::vector<std::string> of_folder() const {
    return {"_source:=folder", "_path:=" + folder_.path().string(), "_folder_existing:=true",
            "_folder_settle:=0.0"};
  }

  ::ros::NodeHandle node_;
  const test::TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_.path() / "us.nrrd";
  Clock clock_;
  Inbox<DiagnosticArray> diagnostics_;
};

TEST_F(FilesBeforeTimeBegins, AFileWaitsForTheTime) {
  expect_a_volume_once_time_has_begun("file", of_file());
}

TEST_F(FilesBeforeTimeBegins, AWatchedFolderWaitsForTheTime) {
  expect_a_volume_once_time_has_begun("folder", of_folder());
}

TEST_F(FilesBeforeTimeBegins, AFileWaitsUntilTheTimeReachesAllItsFrames) {
  expect_a_volume_once_all_frames_are_past("file_from_0", of_file());
}

TEST_F(FilesBeforeTimeBegins, AWatchedFolderWaitsUntilTheTimeReachesAllFrames) {
  expect_a_volume_once_all_frames_are_past("folder_from_0", of_folder());
}

}  // namespace
}  // namespace usct::ros_interface
