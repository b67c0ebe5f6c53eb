#include <gtest/gtest.h>
#include <itkNrrdImageIO.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/io/bad_files.h"
#include "core/io/replaced.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::replaced;
using test::spit;
using test::TemporaryFolder;

/// A file as a user would write it by hand: 3 samples x 2 lines x 2 frames.
const std::string kSizes =
    "NRRD0004\n# a comment\ntype: uchar\ndimension: 3\nsizes: 3 2 2\nencoding: raw\n";
const std::string kSampling = "start_depth_mm:=1.5\nsample_spacing_mm:=0.308\n";
const std::string kMotorised =
    "usct_geometry:=motorised_curvilinear\nprobe_radius_mm:=40\nmotor_radius_mm:=27.25\n"
    "line_pitch_deg:=90\nframe_angles_deg:=-30 60\nframe_travel_deg:=-0.5\n";
const std::string kTracked =
    "usct_geometry:=tracked_linear\nline_positions_mm:=-1 2.5\n"
    "frame_poses_mm:=1 0 0 10 0 1 0 20 0 0 1 30; 0 -1 0 1 1 0 0 2 0 0 1 3\n";
const std::string kData = "abcdefghijkl";

std::string motorised_file() { return kSizes + kSampling + kMotorised + "\n" + kData; }
std::string tracked_file() { return kSizes + kSampling + kTracked + "\n" + kData; }

/// Reads a file of this content.
PreScanVolume read_prescan(const std::string& content) {
  const TemporaryFolder folder;
  return read_prescan_nrrd(spit(folder.path() / "sweep.nrrd", content));
}

TEST(PreScanNrrd, ReadsAMotorisedSweepWrittenByHand) {
  const PreScanVolume volume = read_prescan(motorised_file());
  EXPECT_EQ(volume.geometry.samples(), 3);
  EXPECT_EQ(volume.geometry.axial.start_depth_mm, 1.5);
  EXPECT_EQ(volume.geometry.axial.spacing_mm, 0.308);
  const auto& array = std::get<CurvilinearArray>(volume.geometry.array);
  EXPECT_EQ(array.probe_radius_mm, 40.0);
  ASSERT_EQ(array.line_angles_rad.size(), 2U);
  EXPECT_NEAR(array.line_angles_rad[0], -kPi / 4, 1e-15);
  EXPECT_NEAR(array.line_angles_rad[1], kPi / 4, 1e-15);
  const auto& sweep = std::get<MotorSweep>(volume.geometry.motion);
  EXPECT_EQ(sweep.motor_radius_mm, 27.25);
  EXPECT_NEAR(sweep.frame_angles_rad[0], -kPi / 6, 1e-15);
  EXPECT_NEAR(sweep.frame_angles_rad[1], kPi / 3, 1e-15);
  EXPECT_NEAR(sweep.frame_travel_rad, -0.5 * kDegree, 1e-15);
  EXPECT_EQ(volume.at(2, 1, 0), 'f');  // samples fastest, then lines
  EXPECT_EQ(volume.at(0, 0, 1), 'g');
}

TEST(PreScanNrrd, ReadsATrackedSweepWrittenByHand) {
  const PreScanVolume volume = read_prescan(tracked_file());
  EXPECT_EQ(std::get<LinearArray>(volume.geometry.array).line_positions_mm,
            (std::vector<double>{-1.0, 2.5}));
  const auto& sweep = std::get<TrackedSweep>(volume.geometry.motion);
  // Row-major: the second pose turns x to y.
  EXPECT_EQ(sweep.T_us_frame[1] * Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(1, 3, 3));
  EXPECT_TRUE(sweep.frame_times_s.empty());
}

TEST(PreScanNrrd, ReadsWindowsLineEndsAndADetachedDataFile) {
  const TemporaryFolder folder;
  std::string header = kSizes + kSampling + kMotorised;
  for (std::size_t at = header.find('\n'); at != std::string::npos; at = header.find('\n', at + 2))
    header.replace(at, 1, "\r\n");
  spit(folder.path() / "sweep.raw", kData);
  EXPECT_EQ(read_prescan_nrrd(spit(folder.path() / "a.nhdr", header + "data file: sweep.raw\r\n"))
                .at(0, 0, 1),
            'g');
  expect_input_error(
      [&] {
        read_prescan_nrrd(spit(folder.path() / "b.nhdr", header + "data file: ../etc/passwd\r\n"));
      },
      {"data file", "same folder"});
  expect_input_error(
      [&] { read_prescan_nrrd(spit(folder.path() / "c.nhdr", header + "data file: no.raw\r\n")); },
      {"c.nhdr", "'data file'", "no.raw", "does not exist"});
}

Eigen::Isometry3d arbitrary_pose() {
  const auto number = [] { return *rc::gen::inRange(-1000000, 1000000) * 1.2345e-4; };
  const Eigen::Vector3d axis(number(), number(), number() + 1e-9);
  return Eigen::Translation3d(number(), number(), number()) *
         Eigen::AngleAxisd(number(), axis.normalized());
}

std::vector<double> arbitrary_table(int count, double first, double largest_step) {
  std::vector<double> table = {first};
  while (static_cast<int>(table.size()) < count)
    table.push_back(table.back() + largest_step * *rc::gen::inRange(1, 1000) / 1000.0);
  if (*rc::gen::arbitrary<bool>()) std::reverse(table.begin(), table.end());
  return table;
}

PreScanVolume arbitrary_volume() {
  PreScanVolume volume;
  const int samples = *rc::gen::inRange(2, 20);
  const int lines = *rc::gen::inRange(2, 10);
  const int frames = *rc::gen::inRange(2, 10);
  volume.geometry.axial = {samples, *rc::gen::inRange(0, 1000) / 7.0,
                           *rc::gen::inRange(1, 1000) / 3.0};
  const int kind = *rc::gen::inRange(0, 3);
  if (kind == 2)
    volume.geometry.array = LinearArray{arbitrary_table(lines, -7.7, 1.1)};
  else
    volume.geometry.array =
        CurvilinearArray{*rc::gen::inRange(1, 1000) / 9.0, arbitrary_table(lines, -1.1, 0.1)};
  if (kind == 0) {
    // A motor axis behind the centre of curvature is behind every line, as validate() demands.
    volume.geometry.motion =
        MotorSweep{std::get<CurvilinearArray>(volume.geometry.array).probe_radius_mm +
                       *rc::gen::inRange(1, 1000) / 11.0,
                   arbitrary_table(frames, -0.7, 0.1), *rc::gen::inRange(-100, 100) / 1300.0};
  } else {
    TrackedSweep sweep;
    for (int i = 0; i < frames; ++i) sweep.T_us_frame.push_back(arbitrary_pose());
    if (*rc::gen::arbitrary<bool>())
      for (int i = 0; i < frames; ++i) sweep.frame_times_s.push_back(1.7e9 + i / 30.0);
    volume.geometry.motion = sweep;
  }
  for (int i = 0; i < samples * lines * frames; ++i)
    volume.voxels.push_back(static_cast<std::uint8_t>(i * 37));
  if (*rc::gen::arbitrary<bool>()) volume.acquisition_time = "2024-05-17T09:30:00.25Z";
  return volume;
}

void expect_same_angles(const std::vector<double>& a, const std::vector<double>& b) {
  RC_ASSERT(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    RC_ASSERT(std::abs(a[i] - b[i]) <= 4e-16 * std::abs(a[i]));
}

RC_GTEST_PROP(PreScanNrrd, WhatIsWrittenComesBack, ()) {
  const PreScanVolume volume = arbitrary_volume();
  const TemporaryFolder folder;
  write_prescan_nrrd(volume, folder.path() / "sweep.nrrd");
  RC_ASSERT(is_prescan_nrrd(folder.path() / "sweep.nrrd"));
  const PreScanVolume back = read_prescan_nrrd(folder.path() / "sweep.nrrd");
  RC_ASSERT(back.voxels == volume.voxels);
  RC_ASSERT(back.acquisition_time == volume.acquisition_time);
  // Millimetres and seconds are read back bit by bit.
  RC_ASSERT(back.geometry.axial.start_depth_mm == volume.geometry.axial.start_depth_mm);
  RC_ASSERT(back.geometry.axial.spacing_mm == volume.geometry.axial.spacing_mm);
  RC_ASSERT(back.geometry.array.index() == volume.geometry.array.index());
  if (const auto* linear = std::get_if<LinearArray>(&volume.geometry.array)) {
    RC_ASSERT(std::get<LinearArray>(back.geometry.array).line_positions_mm ==
              linear->line_positions_mm);
  } else {
    const auto& curved = std::get<CurvilinearArray>(volume.geometry.array);
    const auto& curved_back = std::get<CurvilinearArray>(back.geometry.array);
    RC_ASSERT(curved_back.probe_radius_mm == curved.probe_radius_mm);
    expect_same_angles(curved_back.line_angles_rad, curved.line_angles_rad);
  }
  RC_ASSERT(back.geometry.is_motorised() == volume.geometry.is_motorised());
  if (const auto* motor = std::get_if<MotorSweep>(&volume.geometry.motion)) {
    const auto& motor_back = std::get<MotorSweep>(back.geometry.motion);
    RC_ASSERT(motor_back.motor_radius_mm == motor->motor_radius_mm);
    expect_same_angles(motor_back.frame_angles_rad, motor->frame_angles_rad);
    expect_same_angles({motor_back.frame_travel_rad}, {motor->frame_travel_rad});
  } else {
    const auto& sweep = std::get<TrackedSweep>(volume.geometry.motion);
    const auto& sweep_back = std::get<TrackedSweep>(back.geometry.motion);
    RC_ASSERT(sweep_back.frame_times_s == sweep.frame_times_s);
    RC_ASSERT(sweep_back.T_us_frame.size() == sweep.T_us_frame.size());
    for (std::size_t i = 0; i < sweep.T_us_frame.size(); ++i)
      RC_ASSERT(sweep_back.T_us_frame[i].matrix() == sweep.T_us_frame[i].matrix());
  }
}

TEST(PreScanNrrd, IsAPlainNrrdForOtherPrograms) {
  const TemporaryFolder folder;
  const PreScanVolume volume = read_prescan(motorised_file());
  const std::string path = (folder.path() / "sweep.nrrd").string();
  write_prescan_nrrd(volume, path);
  const auto io = itk::NrrdImageIO::New();
  ASSERT_TRUE(io->CanReadFile(path.c_str()));
  io->SetFileName(path);
  io->ReadImageInformation();
  ASSERT_EQ(io->GetNumberOfDimensions(), 3U);
  EXPECT_EQ(io->GetDimensions(0), 3U);
  EXPECT_EQ(io->GetDimensions(1), 2U);
  EXPECT_EQ(io->GetDimensions(2), 2U);
  EXPECT_EQ(io->GetComponentType(), itk::IOComponentEnum::UCHAR);
  std::vector<std::uint8_t> bytes(12);
  io->Read(bytes.data());
  EXPECT_EQ(bytes, test::to_bytes(kData));
}

TEST(PreScanNrrd, ReadsWhatAnotherProgramHasSavedAgain) {
  // ITK's writer changes the order of the header and the encoding, and keeps the keys.
  const TemporaryFolder folder;
  const std::string path = spit(folder.path() / "ours.nrrd", motorised_file()).string();
  const auto reader = itk::NrrdImageIO::New();
  reader->SetFileName(path);
  reader->ReadImageInformation();
  std::vector<std::uint8_t> bytes(12);
  reader->Read(bytes.data());
  for (const bool compressed : {false, true}) {
    const std::string saved = (folder.path() / "theirs.nrrd").string();
    const auto writer = itk::NrrdImageIO::New();
    writer->SetFileName(saved);
    writer->SetNumberOfDimensions(3);
    for (unsigned axis = 0; axis < 3; ++axis)
      writer->SetDimensions(axis, reader->GetDimensions(axis));
    writer->SetComponentType(itk::IOComponentEnum::UCHAR);
    writer->SetPixelType(itk::IOPixelEnum::SCALAR);
    writer->SetUseCompression(compressed);
    writer->SetMetaDataDictionary(reader->GetMetaDataDictionary());
    itk::ImageIORegion region(3);
    for (unsigned axis = 0; axis < 3; ++axis) region.SetSize(axis, reader->GetDimensions(axis));
    writer->SetIORegion(region);
    writer->Write(bytes.data());
    const PreScanVolume volume = read_prescan_nrrd(saved);
    EXPECT_EQ(volume.voxels, test::to_bytes(kData));
    EXPECT_EQ(std::get<MotorSweep>(volume.geometry.motion).motor_radius_mm, 27.25);
  }
}

TEST(PreScanNrrd, RefusesWhatIsMissingDoubleOrContradicted) {
  const auto refuse = [](const std::string& content, std::initializer_list<std::string> fragments) {
    SCOPED_TRACE(content);
    expect_input_error([&] { read_prescan(content); }, fragments);
  };
  const std::string good = motorised_file();
  refuse(replaced(good, "probe_radius_mm:=40\n", ""), {"sweep.nrrd", "probe_radius_mm", "missing"});
  refuse(replaced(good, "start_depth_mm:=1.5\n", ""), {"start_depth_mm", "missing"});
  refuse(replaced(good, "line_pitch_deg:=90\n", ""),
         {"line_angles_deg", "line_pitch_deg", "neither"});
  refuse(replaced(good, "line_pitch_deg:=90\n", "line_pitch_deg:=90\nline_angles_deg:=-45 45\n"),
         {"line_angles_deg", "line_pitch_deg", "both"});
  refuse(replaced(good, "start_depth_mm", "start_depth_mm:=1.6\nstart_depth_mm"),
         {"start_depth_mm", "twice"});
  EXPECT_NO_THROW(
      read_prescan(replaced(good, "start_depth_mm", "start_depth_mm:=1.5\nstart_depth_mm")));
  refuse(replaced(good, "sizes", "sizes: 3 2 2\nsizes"), {"sizes", "twice"});
  refuse(replaced(good, "frame_travel_deg", "frame_travell_deg"), {"frame_travell_deg", "unknown"});
  refuse(replaced(good, "frame_travel_deg", "usct_travel"), {"usct_travel", "unknown"});
  refuse(replaced(good, "frame_travel_deg", "line_positions_mm"), {"line_positions_mm"});
  refuse(replaced(good, "motorised_curvilinear", "spherical"), {"usct_geometry", "spherical"});
  refuse(replaced(good, "usct_geometry:=motorised_curvilinear\n", ""),
         {"usct_geometry", "missing"});
  refuse(replaced(good, "-30 60", "-30 0 60"), {"frame_angles_deg", "3", "2"});
  refuse(replaced(good, "-30 60", "60 60"), {"frame_angles"});
  refuse(replaced(good, "0.308", "nan"), {"sample_spacing_mm", "nan", "finite"});
  refuse(replaced(good, "0.308", "-0.308"), {"sample_spacing_mm", "-0.308", "> 0"});
  refuse(replaced(good, "0.308", "0.308 mm"), {"sample_spacing_mm", "0.308 mm"});
  refuse(replaced(good, "uchar", "short"), {"type", "short", "unsigned char"});
  refuse(replaced(good, "dimension: 3", "dimension: 4"), {"dimension", "4"});
  refuse(replaced(good, "sizes: 3 2 2", "sizes: 3 2"), {"sizes", "3 2"});
  refuse(replaced(good, "encoding: raw", "encoding: bzip2"), {"encoding", "bzip2", "gzip"});
  refuse(replaced(good, "encoding: raw", "encoding: raw\nbyte skip: 5"), {"byte skip"});
  refuse(replaced(good, "encoding: raw", "encoding: raw\nnonsense"), {"nonsense"});
  refuse(replaced(good, "NRRD0004", "NRRD0009"), {"NRRD0009"});
  refuse(replaced(good, "usct_geometry", "acquisition_time:=yesterday\nusct_geometry"),
         {"acquisition_time", "yesterday", "ISO 8601"});
  refuse(replaced(tracked_file(), "10 0 1 0", "10 0 1"), {"frame_poses_mm", "frame 0", "12"});
  refuse(replaced(tracked_file(), "10 0 1 0", "10 0 2 0"),
         {"frame_poses_mm", "frame 0", "rotation"});
  refuse(replaced(tracked_file(), ";", ""), {"frame_poses_mm", "1", "2"});
  refuse(replaced(tracked_file(), "usct_geometry", "frame_times_s:=2 1\nusct_geometry"),
         {"frame_times_s"});
  refuse(replaced(tracked_file(), "usct_geometry", "frame_times_s:=2\nusct_geometry"),
         {"frame_times_s", "1", "2"});
}

TEST(PreScanNrrd, LeavesKeysOfOtherProgramsAlone) {
  EXPECT_NO_THROW(
      read_prescan(replaced(motorised_file(), "usct_geometry", "patient:=none\nusct_geometry")));
}

TEST(PreScanNrrd, RefusesSizesThatTheDataDoNotBear) {
  const auto refuse = [](const std::string& sizes, const std::string& encoding,
                         std::initializer_list<std::string> fragments) {
    SCOPED_TRACE(sizes + " " + encoding);
    const std::string content = replaced(motorised_file(), "sizes: 3 2 2", "sizes: " + sizes);
    expect_input_error([&] { read_prescan(replaced(content, "raw", encoding)); }, fragments);
  };
  // A reader that trusted these sizes would allocate up to 2^93 bytes.
  refuse("3 2 3", "raw", {"sizes", "18", "12"});
  refuse("3 2 1", "raw", {"sizes", "6", "12"});
  refuse("2147483647 2147483647 2147483647", "raw", {"sizes", "too large"});
  refuse("2147483647 2147483647 1", "raw", {"sizes", "4611686014132420609"});
  refuse("2147483647 100 1", "gzip", {"sizes", "cannot hold"});
  refuse("2 2147483647 1", "gzip", {"sizes", "cannot hold"});
  refuse("-3 2 2", "raw", {"sizes", "-3", ">= 1"});
  refuse("3 0 2", "raw", {"sizes", "0", ">= 1"});
  refuse("3000000000 2 2", "raw", {"sizes", "3000000000"});
}

TEST(PreScanNrrd, RefusesCompressedDataThatEndEarlyOrLate) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "sweep.nrrd";
  write_prescan_nrrd(read_prescan(motorised_file()), path);
  const test::FileBytes written = test::slurp(path);
  const std::string good(written.begin(), written.end());
  expect_input_error([&] { read_prescan(replaced(good, "sizes: 3 2 2", "sizes: 3 2 3")); },
                     {"12", "18"});
  expect_input_error([&] { read_prescan(replaced(good, "sizes: 3 2 2", "sizes: 3 2 1")); },
                     {"more", "6"});
  test::FileBytes damaged = written;
  damaged[damaged.size() - 6] ^= 0x55;  // checksum
  spit(path, damaged);
  expect_input_error([&] { read_prescan_nrrd(path); }, {path.string(), "damaged"});
}

TEST(PreScanNrrd, RefusesBrokenFiles) {
  const auto read_path = [](const std::filesystem::path& path) { read_prescan_nrrd(path); };
  test::expect_refuses_broken_files(read_path, test::to_bytes(motorised_file()), ".nrrd");
  const TemporaryFolder folder;
  write_prescan_nrrd(read_prescan(tracked_file()), folder.path() / "compressed.nrrd");
  test::expect_refuses_broken_files(read_path, test::slurp(folder.path() / "compressed.nrrd"),
                                    ".nrrd");
}

/// Whoever asks what is wrong with a file needs to see it.
TEST(PreScanNrrd, AnAbsurdFieldOfViewIsShown) {
  const TemporaryFolder folder;
  const auto path = spit(folder.path() / "us.nrrd", replaced(motorised_file(), "0.308", "1e9"));
  const auto json = nlohmann::json::parse(describe_prescan_nrrd(path));
  EXPECT_GT(json["field_of_view_mm"][1].get<double>(), 1e9) << json;
}

TEST(PreScanNrrd, FramesOffThePathAreNamed) {
  PreScanVolume volume;
  volume.geometry.axial = {4, 3.0, 1.5};
  volume.geometry.array = LinearArray{{-1.0, 0.0, 1.0}};
  TrackedSweep sweep;
  for (int frame = 0; frame < 40; ++frame)
    sweep.T_us_frame.emplace_back(Eigen::Translation3d(frame == 7 ? 300.0 : 0.0, 0.0, frame));
  volume.geometry.motion = sweep;
  volume.voxels.resize(4 * 3 * 40);
  const TemporaryFolder folder;
  write_prescan_nrrd(volume, folder.path() / "us.nrrd");
  const std::string described = describe_prescan_nrrd(folder.path() / "us.nrrd");
  EXPECT_NE(described.find("poses of 1 of 40 frames, frame 7 first"), std::string::npos);
}

TEST(PreScanNrrd, LeavesNoFileBehindWhenTheVolumeIsInvalid) {
  const TemporaryFolder folder;
  PreScanVolume volume = read_prescan(motorised_file());
  volume.voxels.pop_back();
  expect_input_error([&] { write_prescan_nrrd(volume, folder.path() / "out.nrrd"); }, {"voxels"});
  volume = read_prescan(motorised_file());
  volume.acquisition_time = "now\nprobe_radius_mm:=3";  // would forge a key
  expect_input_error([&] { write_prescan_nrrd(volume, folder.path() / "out.nrrd"); },
                     {"acquisition_time"});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(PreScanNrrd, IsNoVolume) {
  const TemporaryFolder folder;
  const std::filesystem::path path = spit(folder.path() / "us.nrrd", motorised_file());
  expect_input_error([&] { read_ct(path); }, {"us.nrrd", "ultrasound sequence, must be a volume"});
}

TEST(PreScanNrrd, IsToldApartFromOtherFiles) {
  const TemporaryFolder folder;
  EXPECT_FALSE(is_prescan_nrrd(folder.path()));
  EXPECT_FALSE(is_prescan_nrrd(folder.path() / "none.nrrd"));
  EXPECT_FALSE(is_prescan_nrrd(spit(folder.path() / "ct.nrrd", kSizes + "\nusct_geometry:=x")));
  EXPECT_TRUE(is_prescan_nrrd(spit(folder.path() / "us.nrrd", motorised_file())));
}

}  // namespace
}  // namespace usct
