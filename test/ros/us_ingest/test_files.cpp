#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosgraph_msgs/Log.h>
#include <us_ct_registration/Acquisition.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/io/temporary_folder.h"
#include "core/ultrasound/lagging_sweep.h"
#include "inbox.h"
#include "ros/conversions/ultrasound.h"
#include "ros/process.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
namespace fs = std::filesystem;
using testing::HasSubstr;

TEST(Parameters, AnUnknownKeyEndsTheNodeAndIsNamed) {
  const auto [output, status] =
      Process("us_ingest", {"__name:=misspelt", "_swep_pause:=1.0"}).end();
  EXPECT_EQ(status, 2);
  EXPECT_THAT(output, HasSubstr("/misspelt/swep_pause"));
}

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Whether `text` occurs in any of the messages.
template <typename Message>
bool is_named(const Inbox<Message>& inbox, const std::string& text) {
  for (const auto& message : inbox.all()) {
    std::ostringstream shown;
    shown << *message;
    if (shown.str().find(text) != std::string::npos) return true;
  }
  return false;
}

TEST(Folder, TakesWholeFilesReportsBadOnesAndGoesOn) {
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
  const Inbox<msg::Acquisition> announced(node, "/watching/us/announced");
  const Inbox<diagnostic_msgs::DiagnosticArray> diagnostics(node, "/diagnostics");
  const Process process("us_ingest",
                        {"__ns:=watching", "_source:=folder", "_path:=" + folder.path().string(),
                         "_folder_period:=0.05", "_folder_settle:=2.0"});
  ASSERT_TRUE(wait_for_diagnostics(diagnostics, "watching", diagnostic_msgs::DiagnosticStatus::OK,
                                   "waiting"));
  // Half of a file is written, at which the node looks many times until its next report, then the
  // rest.
  std::ofstream half(folder.path() / "half.nrrd", std::ios::binary);
  half << bytes.substr(0, bytes.size() / 2) << std::flush;
  const std::size_t reports = diagnostics.all().size();
  ASSERT_TRUE(eventually([&] { return diagnostics.all().size() >= reports + 3; }));
  half << bytes.substr(bytes.size() / 2);
  half.close();
  ASSERT_TRUE(volumes.wait(1));
  EXPECT_EQ(from_message(*volumes.all()[0], "volume").voxels, volume.voxels);
  EXPECT_EQ(volumes.all()[0]->header.stamp, ::ros::Time(1715938200, 0));
  EXPECT_EQ(volumes.all()[0]->header.frame_id, "us");

  // A share that has dropped out and is back is an error no longer, though no file comes.
  const fs::path away = elsewhere.path() / "away";
  fs::rename(folder.path(), away);
  EXPECT_TRUE(wait_for_diagnostics(diagnostics, "watching",
                                   diagnostic_msgs::DiagnosticStatus::ERROR,
                                   "the folder cannot be read"));
  fs::rename(away, folder.path());
  const Inbox<diagnostic_msgs::DiagnosticArray> later(node, "/diagnostics");
  EXPECT_TRUE(wait_for_diagnostics(later, "watching", diagnostic_msgs::DiagnosticStatus::OK,
                                   "volumes published"));

  // The names of files may be those of patients.
  const Inbox<rosgraph_msgs::Log> log(node, "/rosout");
  std::ofstream(folder.path() / "DOE_JOHN.nrrd", std::ios::binary)
      << bytes.substr(0, bytes.size() / 2);
  EXPECT_TRUE(wait_for_diagnostics(diagnostics, "watching",
                                   diagnostic_msgs::DiagnosticStatus::ERROR,
                                   "file 2 of the watched folder: "));
  EXPECT_FALSE(is_named(diagnostics, "DOE_JOHN"));
  ASSERT_TRUE(eventually([&] { return is_named(log, "file 2 of the watched folder"); }));
  EXPECT_FALSE(is_named(log, "DOE_JOHN"));
  // Whoever asks for the newest ultrasound must not get the file before.
  ASSERT_TRUE(eventually([&] { return is_named(announced, "file 2 of the watched folder"); }));
  EXPECT_EQ(announced.all().back()->state, msg::Acquisition::REFUSED);
  EXPECT_GT(announced.all().back()->header.stamp, volumes.all()[0]->header.stamp);
  EXPECT_FALSE(is_named(announced, "DOE_JOHN"));
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
  const Process process(
      "us_ingest", {"__ns:=reading", "_source:=file", "_frame_id:=patient", "_file_stamp:=reading",
                    "_path:=" + (folder.path() / "us.nrrd").string()});
  ASSERT_TRUE(wait_for_diagnostics(diagnostics, "reading", diagnostic_msgs::DiagnosticStatus::OK,
                                   "published"));
  const Inbox<msg::PreScanVolume> volumes(node, "/reading/us/volume");
  ASSERT_TRUE(volumes.wait(1));
  EXPECT_EQ(volumes.all()[0]->data, volume.voxels);
  EXPECT_EQ(volumes.all()[0]->header.frame_id, "patient");
}

TEST(File, OneThatIsMissingEndsTheNodeAndIsNamed) {
  const auto [output, status] =
      Process("us_ingest", {"__name:=no_file", "_source:=file", "_path:=/no/such.nrrd"}).end();
  EXPECT_EQ(status, 2);
  EXPECT_THAT(output, HasSubstr("/no/such.nrrd"));
}

}  // namespace
}  // namespace usct::ros_interface
