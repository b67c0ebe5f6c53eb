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

  void expect_a_volume_once_time_has_begun(const std::string& space,
                                           const std::vector<std::string>& parameters) {
    std::vector<std::string> arguments{"__ns:=" + space, "_file_stamp:=reading",
                                       "_diagnostic_period:=0.05"};
    arguments.insert(arguments.end(), parameters.begin(), parameters.end());
    const Process process("us_ingest", arguments);
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

  ::ros::NodeHandle node_;
  const test::TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_.path() / "us.nrrd";
  Clock clock_;
  Inbox<DiagnosticArray> diagnostics_;
};

TEST_F(FilesBeforeTimeBegins, AFileWaitsForTheTime) {
  expect_a_volume_once_time_has_begun("file", {"_source:=file", "_path:=" + file_.string()});
}

TEST_F(FilesBeforeTimeBegins, AWatchedFolderWaitsForTheTime) {
  expect_a_volume_once_time_has_begun(
      "folder", {"_source:=folder", "_path:=" + folder_.path().string(), "_folder_existing:=true",
                 "_folder_settle:=0.0"});
}

/// Simulators begin at 0, where the first frames of the sweep would lie before it.
TEST_F(FilesBeforeTimeBegins, AFileWaitsUntilTheTimeReachesAllItsFrames) {
  const Process process("us_ingest", {"__ns:=from_0", "_file_stamp:=reading", "_source:=file",
                                      "_path:=" + file_.string(), "_diagnostic_period:=0.05"});
  const Inbox<msg::PreScanVolume> volumes(node_, "from_0/us/volume");
  clock_.set(::ros::Time(0.5));
  ASSERT_TRUE(wait_for_diagnostics(diagnostics_, "from_0", DiagnosticStatus::WARN, "at 0.500 s"));
  clock_.set(::ros::Time(2.0));
  ASSERT_TRUE(volumes.wait(1));
  EXPECT_EQ(volumes.all()[0]->header.stamp, ::ros::Time(2.0));
}

}  // namespace
}  // namespace usct::ros_interface
