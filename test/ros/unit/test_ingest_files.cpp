#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/io/temporary_folder.h"
#include "ros/conversions/times.h"
#include "ros/conversions/ultrasound.h"
#include "ros/ingest/file_source.h"
#include "ros/ingest/ultrasound_file.h"
#include "ros/ingest/watched_folder.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

namespace usct::ros_interface {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

void write(const fs::path& path, const std::string& text) {
  std::ofstream(path, std::ios::app) << text;
}

TEST(WatchedFolder, TakesAFileOnceWhenItHasStoppedGrowing) {
  const test::TemporaryFolder folder;
  WatchedFolder watched(folder.path(), "", 1.0, false, 0.0);
  write(folder.path() / "a", "1");
  EXPECT_THAT(watched.take(1.0), IsEmpty());
  write(folder.path() / "a", "2");
  EXPECT_THAT(watched.take(2.0), IsEmpty());  // the file has grown
  EXPECT_THAT(watched.take(2.9), IsEmpty());
  EXPECT_THAT(watched.take(3.0), ElementsAre(folder.path() / "a"));
  EXPECT_THAT(watched.take(9.0), IsEmpty());
  write(folder.path() / "a", "3");
  EXPECT_THAT(watched.take(10.0), IsEmpty());
  EXPECT_THAT(watched.take(11.0), ElementsAre(folder.path() / "a"));
}

TEST(WatchedFolder, LeavesOldHiddenAndOtherFilesAlone) {
  const test::TemporaryFolder folder;
  write(folder.path() / "old.nrrd", "1");
  WatchedFolder watched(folder.path(), ".nrrd", 0.0, false, 0.0);
  WatchedFolder greedy(folder.path(), ".nrrd", 0.0, true, 0.0);
  EXPECT_EQ(watched.passed_over(), 1U);
  EXPECT_EQ(greedy.passed_over(), 0U);
  write(folder.path() / ".tmp-new.nrrd", "1");
  write(folder.path() / "new.txt", "1");
  write(folder.path() / "new.nrrd", "1");
  fs::create_directory(folder.path() / "folder.nrrd");
  EXPECT_THAT(watched.take(1.0), ElementsAre(folder.path() / "new.nrrd"));
  EXPECT_THAT(greedy.take(1.0),
              ElementsAre(folder.path() / "old.nrrd", folder.path() / "new.nrrd"));
}

TEST(WatchedFolder, AFileThatWasAbsentForAWhileIsNotNew) {
  const test::TemporaryFolder folder;
  const test::TemporaryFolder elsewhere;
  write(folder.path() / "old", "1");
  WatchedFolder watched(folder.path(), "", 0.0, false, 0.0);
  write(folder.path() / "taken", "1");
  EXPECT_THAT(watched.take(1.0), ElementsAre(folder.path() / "taken"));
  for (const char* name : {"old", "taken"})
    fs::rename(folder.path() / name, elsewhere.path() / name);
  EXPECT_THAT(watched.take(2.0), IsEmpty());
  for (const char* name : {"old", "taken"})
    fs::rename(elsewhere.path() / name, folder.path() / name);
  EXPECT_THAT(watched.take(3.0), IsEmpty());
  fs::remove(folder.path() / "taken");
  EXPECT_THAT(watched.take(4.0), IsEmpty());
  write(folder.path() / "taken", "12");
  EXPECT_THAT(watched.take(5.0), ElementsAre(folder.path() / "taken"));
}

TEST(WatchedFolder, SaysThatTheFolderCannotBeRead) {
  EXPECT_THROW(WatchedFolder("/no/such/folder", "", 1.0, false, 0.0), InputError);
}

TEST(TimeFromUtc, CountsFromTheEpoch) {
  EXPECT_EQ(time_from_utc("1970-01-01T00:00:00Z", "file"), ::ros::Time(0, 0));
  EXPECT_EQ(time_from_utc("2024-05-17T09:30:00.25Z", "file"), ::ros::Time(1715938200, 250000000));
  EXPECT_EQ(utc_text(::ros::Time(1715938200, 250000000)), "2024-05-17T09:30:00.250Z");
  EXPECT_EQ(utc_text(::ros::Time(4291747199, 0)), "2105-12-31T23:59:59.000Z");
  EXPECT_THROW(time_from_utc("1969-12-31T23:59:59Z", "file"), InputError);
  EXPECT_THROW(time_from_utc("2024-05-17", "file"), InputError);
}

TEST(StampedMessage, HasTheAcquisitionTimeOrIsRefused) {
  const test::TemporaryFolder folder;
  PreScanVolume volume;
  volume.geometry = {
      {2, 1.0, 0.5}, CurvilinearArray{40.0, {-0.1, 0.1}}, MotorSweep{27.0, {0.0, 0.1}, 0.0}};
  volume.voxels = {1, 2, 3, 4, 5, 6, 7, 8};
  volume.acquisition_time = "2024-05-17T09:30:00Z";
  UltrasoundSource source;
  source.path = folder.path() / "us.nrrd";
  write_prescan_nrrd(volume, source.path);
  std::vector<std::string> warnings;
  PreScanVolume read = read_prescan_file(source, warnings);
  const auto stamped = [&](FileStamp stamp, const ::ros::Time& now) {
    return stamped_message(read, "probe", stamp, now, "us.nrrd");
  };
  const ::ros::Time later(1716000000, 0);
  const auto found = stamped(FileStamp::kAcquisition, later);
  EXPECT_EQ(found->header.stamp, ::ros::Time(1715938200, 0));
  EXPECT_EQ(found->header.frame_id, "probe");
  EXPECT_EQ(from_message(*found, "message").voxels, volume.voxels);
  // It is in the future of this clock.
  EXPECT_THROW(stamped(FileStamp::kAcquisition, ::ros::Time(7.0)), InputError);

  read.acquisition_time.clear();
  EXPECT_THROW(stamped(FileStamp::kAcquisition, later), InputError);
  EXPECT_EQ(stamped(FileStamp::kReading, ::ros::Time(7.0))->header.stamp, ::ros::Time(7.0));
}

/// roscpp would close the connections of all subscribers for ever.
TEST(FileVolume, ThatNoMessageCanHoldIsRefused) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "us.nrrd";
  const std::string header =
      "NRRD0005\ntype: unsigned char\ndimension: 3\nsizes: 240000000 2 2\nencoding: raw\n"
      "usct_geometry:=motorised_curvilinear\nstart_depth_mm:=0\nsample_spacing_mm:=1e-6\n"
      "probe_radius_mm:=40\nline_angles_deg:=-5 5\nmotor_radius_mm:=27\n"
      "frame_angles_deg:=-5 5\nacquisition_time:=2024-05-17T09:30:00Z\n\n";
  write(path, header);
  fs::resize_file(path, header.size() + 960'000'000);  // sparse
  const FileVolume read(path, "file 1", {});
  EXPECT_THAT([&] { read.stamped(::ros::Time(1716000000, 0)); },
              testing::ThrowsMessage<std::runtime_error>(
                  HasSubstr("file 1: has 960000000 samples, must have <= 950000000")));
}

TEST(FileStamp, OfReadingWaitsForTheClockAlone) {
  EXPECT_THAT(awaited(FileStamp::kReading, ::ros::Time(), 0.0), HasSubstr("/clock"));
  EXPECT_EQ(awaited(FileStamp::kReading, ::ros::TIME_MIN, 0.0), "");
  EXPECT_THAT(awaited(FileStamp::kReading, ::ros::Time(2.0), 2.0), HasSubstr("2.000 s"));
  EXPECT_EQ(awaited(FileStamp::kReading, ::ros::Time(2.1), 2.0), "");
  EXPECT_EQ(awaited(FileStamp::kAcquisition, ::ros::Time(), 0.0), "");
}

}  // namespace
}  // namespace usct::ros_interface
