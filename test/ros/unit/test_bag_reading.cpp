#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <tf2_msgs/TFMessage.h>
#include <us_ct_registration/PreScanFrame.h>

#include <array>
#include <fstream>

#include "bag_sweeps.h"
#include "core/io/file_size_limit.h"
#include "core/io/temporary_folder.h"
#include "core/tools/run_usct.h"
#include "ros/conversions/ct.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using test::TemporaryFolder;

struct ReadBack {
  std::vector<PreScanVolume> volumes;
  std::vector<std::string> frame_ids;
  std::vector<CtVolume> cts;
  std::vector<std::string> warnings;
};

ReadBack read_back(const std::filesystem::path& bag, const std::string& pose_frame = "") {
  ReadBack found;
  BagVisitor visitor;
  visitor.pose_frame = pose_frame;
  visitor.us = [&](const msg::PreScanVolume& volume) {
    found.volumes.push_back(from_message(volume, "bag"));
    found.frame_ids.push_back(volume.header.frame_id);
  };
  visitor.ct = [&](const msg::CtVolume& ct) { found.cts.push_back(from_message(ct, "bag")); };
  visitor.warning = [&](const std::string& text) { found.warnings.push_back(text); };
  visit_acquisition_bag(bag, visitor);
  return found;
}

TEST(AcquisitionBag, MotorisedSweepsComeBackBitByBit) {
  const TemporaryFolder folder;
  write_acquisition_bag({{motorised(), {}, {}}, {motorised(), {}, {}}}, {}, options_at(100.0),
                        folder.path() / "a.bag");
  const ReadBack found = read_back(folder.path() / "a.bag");
  EXPECT_THAT(found.warnings, testing::IsEmpty());
  ASSERT_EQ(found.volumes.size(), 2u);
  const auto written = std::get<MotorSweep>(motorised().geometry.motion);
  for (const PreScanVolume& volume : found.volumes) {
    EXPECT_EQ(volume.voxels, motorised().voxels);
    EXPECT_EQ(std::get<MotorSweep>(volume.geometry.motion).frame_angles_rad,
              written.frame_angles_rad);
  }
}

TEST(AcquisitionBag, TrackedSweepsComeBackFromFramesAndFromTf) {
  const TemporaryFolder folder;
  const auto written = std::get<TrackedSweep>(tracked().geometry.motion);
  for (const bool in_tf : {false, true}) {
    BagOptions options = options_at(100.0);
    options.poses_in_tf = in_tf;
    const std::filesystem::path bag = folder.path() / (in_tf ? "tf.bag" : "frames.bag");
    write_acquisition_bag({{tracked(), {}, {}}}, {}, options, bag);
    const ReadBack found = read_back(bag);
    EXPECT_THAT(found.warnings, testing::IsEmpty());
    ASSERT_EQ(found.volumes.size(), 1u);
    EXPECT_EQ(found.frame_ids[0], "us");
    EXPECT_EQ(found.volumes[0].voxels, tracked().voxels);
    const auto& sweep = std::get<TrackedSweep>(found.volumes[0].geometry.motion);
    ASSERT_EQ(sweep.T_us_frame.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_TRUE(sweep.T_us_frame[i].isApprox(written.T_us_frame[i], 1e-9));
      EXPECT_NEAR(sweep.frame_times_s[i], written.frame_times_s[i], 1e-6);
    }
  }
}

TEST(AcquisitionBag, VolumesOfARecordingComeBeforeItsFrames) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.bag";
  write_acquisition_bag({{motorised(), {}, {}}}, {}, options_at(100.0), path);
  PreScanVolume other = motorised();
  other.voxels.assign(other.voxels.size(), 9);
  std_msgs::Header header;
  header.frame_id = "us";
  header.stamp = ::ros::Time(101);
  {
    rosbag::Bag bag(path.string(), rosbag::bagmode::Append);
    bag.write("/scanner/volume", header.stamp, to_message(other, header));
  }
  const ReadBack found = read_back(path);
  ASSERT_EQ(found.volumes.size(), 1u);
  EXPECT_EQ(found.volumes[0].voxels, other.voxels);
  {
    rosbag::Bag bag(path.string(), rosbag::bagmode::Append);
    bag.write("/other/volume", header.stamp, to_message(other, header));
  }
  EXPECT_THROW(read_back(path), InputError) << "which of the two topics?";
}

/// A bag of a tracked sweep whose poses are in tf. Those within `silence`, s since the first frame,
/// are left out; the images have the frame `image_frame`.
void write_with_tf(const std::filesystem::path& path, const std::array<double, 2>& silence,
                   const std::string& image_frame) {
  const TemporaryFolder folder;
  BagOptions options = options_at(100.0);
  options.poses_in_tf = true;
  write_acquisition_bag({{tracked(), {}, {}}}, {}, options, folder.path() / "whole.bag");
  const rosbag::Bag whole((folder.path() / "whole.bag").string());
  rosbag::Bag bag(path.string(), rosbag::bagmode::Write);
  for (const rosbag::MessageInstance& one : rosbag::View(whole)) {
    const double since_s = one.getTime().toSec() - 100.0;
    if (const auto frame = one.instantiate<msg::PreScanFrame>()) {
      msg::PreScanFrame changed = *frame;
      changed.header.frame_id = image_frame;
      bag.write(one.getTopic(), one.getTime(), changed);
    } else if (since_s < silence[0] || since_s > silence[1]) {
      bag.write(one.getTopic(), one.getTime(), one);
    }
  }
  tf2_msgs::TFMessage calibration;
  calibration.transforms = {stamped_transform(::ros::Time(99.0), pose(0.3, {0.0, 5.0, 1.0}),
                                              options.array_frame, "us_image")};
  bag.write("/tf_static", ::ros::Time(99.0), calibration);
}

TEST(AcquisitionBag, NoPoseIsMadeUpWhereTheTrackerWasSilent) {
  const TemporaryFolder folder;
  write_with_tf(folder.path() / "a.bag", {0.1, 1.4}, "us_array");
  const ReadBack found = read_back(folder.path() / "a.bag");
  EXPECT_TRUE(found.volumes.empty());
  EXPECT_THAT(found.warnings, testing::ElementsAre(testing::AllOf(
                                  testing::HasSubstr("2 of 4 frames are missing"),
                                  testing::HasSubstr("tf had no transform from 'us_array'"))));
}

TEST(AcquisitionBag, AnArrayThatDoesNotMoveInItsParentNeedsThePoseFrame) {
  const TemporaryFolder folder;
  write_with_tf(folder.path() / "a.bag", {1.0, 0.0}, "us_image");
  const ReadBack unnamed = read_back(folder.path() / "a.bag");
  EXPECT_TRUE(unnamed.volumes.empty());
  EXPECT_THAT(unnamed.warnings,
              testing::ElementsAre(testing::HasSubstr("'us_image' does not move in 'us_array'")));
  const ReadBack named = read_back(folder.path() / "a.bag", "us");
  ASSERT_EQ(named.volumes.size(), 1u);
  EXPECT_EQ(named.frame_ids[0], "us");
  const auto& sweep = std::get<TrackedSweep>(named.volumes[0].geometry.motion);
  const auto written = std::get<TrackedSweep>(tracked().geometry.motion);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_TRUE(
        sweep.T_us_frame[i].isApprox(written.T_us_frame[i] * pose(0.3, {0.0, 5.0, 1.0}), 1e-9));
}

TEST(AcquisitionBag, AFullDiskIsToldAndLeavesNoPartOfABag) {
  const TemporaryFolder folder;
  PreScanVolume large = motorised();
  large.geometry.axial.samples = 4000;
  large.voxels.assign(std::size_t{4000} * 2 * 4, 1);
  for (const rlim_t bytes : {rlim_t{16}, rlim_t{6000}, rlim_t{20000}}) {
    const test::FileSizeLimit full(bytes);
    EXPECT_THROW(
        write_acquisition_bag({{large, {}, {}}}, {}, options_at(100.0), folder.path() / "a.bag"),
        std::runtime_error);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(AcquisitionBag, WhatIsNoBagIsRefused) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "no.bag") << "no bag at all";
  const auto refusal_of = [&](const char* name) -> std::string {
    try {
      read_back(folder.path() / name);
    } catch (const InputError& error) {
      return error.violation();
    }
    return "";
  };
  EXPECT_EQ(refusal_of("no.bag"), "is no bag: it does not begin with '#ROSBAG'");
  EXPECT_EQ(refusal_of("absent.bag"), "does not exist");
  EXPECT_EQ(refusal_of("."), "is no file, must be a bag");
  std::ofstream(folder.path() / "broken.bag") << "#ROSBAG V2.0\n";
  EXPECT_THAT(refusal_of("broken.bag"), testing::HasSubstr("rosbag reindex"));
}

TEST(BagTool, WritesListsAndReadsBackWhatItWasGiven) {
  const TemporaryFolder folder;
  const auto path = [&](const char* name) { return (folder.path() / name).string(); };
  write_prescan_nrrd(motorised(), path("us.nrrd"));
  const test::Outcome write = test::run_usct({"bag", "write", "--us", path("us.nrrd"), "--us",
                                              path("us.nrrd"), "--output", path("a.bag")});
  ASSERT_EQ(write.exit_status, 0) << write.errors;
  const test::Outcome info = test::run_usct({"bag", "info", path("a.bag")});
  EXPECT_THAT(info.output, testing::HasSubstr("ultrasound 1: geometry motorised_curvilinear"));
  EXPECT_THAT(info.output, testing::HasSubstr("samples_lines_frames [3,2,4]"));
  const test::Outcome read =
      test::run_usct({"bag", "read", path("a.bag"), "--us", path("back.nrrd"), "--index", "1"});
  ASSERT_EQ(read.exit_status, 0) << read.errors;
  EXPECT_EQ(read_prescan_nrrd(path("back.nrrd")).voxels, motorised().voxels);
  const test::Outcome beyond =
      test::run_usct({"bag", "read", path("a.bag"), "--us", path("no.nrrd"), "--index", "2"});
  EXPECT_EQ(beyond.exit_status, 2);
  EXPECT_THAT(beyond.errors,
              testing::HasSubstr("number of sweeps is 2, --index is 2, must be less"));
}

/// Another ending is that of another kind of file, which must not be lost by a slip.
TEST(BagTool, OutputsOfAnotherKindOfFileAreRefused) {
  const TemporaryFolder folder;
  const auto path = [&](const char* name) { return (folder.path() / name).string(); };
  write_prescan_nrrd(motorised(), path("us.nrrd"));
  std::ofstream(path("labels.nii")) << "precious";
  std::ofstream(path("labels.txt")) << "precious";
  const auto refused = [&](std::vector<std::string> arguments, const std::string& named) {
    arguments.insert(arguments.begin(), "bag");
    const test::Outcome outcome = test::run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 2);
    EXPECT_THAT(outcome.errors, testing::HasSubstr(named));
    for (const char* kept : {"labels.nii", "labels.txt"})
      EXPECT_EQ(test::read_text(path(kept)), "precious");
  };
  const std::vector<std::string> write = {"write", "--us", path("us.nrrd"), "--output"};
  const auto with = [](std::vector<std::string> arguments, const std::vector<std::string>& more) {
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  };
  refused(with(write, {path("labels.nii")}), "must end in .bag");
  refused(with(write, {path("a.bag"), "--frame-rate", "0"}), "'frame_rate_hz' (--frame-rate) is 0");
  ASSERT_EQ(test::run_usct(with({"bag"}, with(write, {path("a.bag")}))).exit_status, 0);
  refused({"read", path("a.bag"), "--us", path("labels.nii")}, "--us: is '");
  refused({"read", path("a.bag"), "--ct", path("labels.txt")}, "--ct: is '");
  refused({"video", path("a.bag"), "--topic", "/a", "--output", path("labels.nii")},
          "must end in .avi");
}

}  // namespace
}  // namespace usct::ros_interface
