#include <gtest/gtest.h>

#include <limits>

#include "core/io/bad_files.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::spit;
using test::TemporaryFolder;

constexpr std::int32_t kMaxInt32 = std::numeric_limits<std::int32_t>::max();

/// A file made from the published layout, byte by byte, not by our writer.
struct UltrasonixFile {
  std::int32_t type = 2, frames = 6, w = 3, h = 4, ss = 8, sf = 2'500'000;
  bool tags = false;

  test::FileBytes bytes() const {
    test::FileBytes result;
    for (const std::int32_t value :
         {type, frames, w, h, ss, 1, 2, 3, 4, 5, 6, 7, 8, 21, 5'000'000, sf, 30, 128, 0})
      test::append_int32(result, value);
    for (int frame = 0; frame < 6; ++frame) {
      if (tags) test::append_int32(result, 100 + frame);
      for (int i = 0; i < 12; ++i) result.push_back(static_cast<std::uint8_t>(20 * frame + i));
    }
    return result;
  }
};

UltrasonixSequence read_ultrasonix_file(const UltrasonixFile& file) {
  const TemporaryFolder folder;
  return read_ultrasonix(spit(folder.path() / "frames.bpr", file.bytes()));
}

ProbeConfig linear_probe() {
  ProbeConfig config;
  config.array = CurvilinearArray{40.0, {-0.1, 0.0, 0.1}};
  config.motor = ProbeMotor{27.25, 0.005, 2, {}, 0.001};
  config.sampling.speed_of_sound_m_per_s = 1540.0;
  return config;
}

TEST(Ultrasonix, ReadsHeaderAndFramesWithAndWithoutTags) {
  for (const bool tags : {false, true}) {
    UltrasonixFile file;
    file.tags = tags;
    const UltrasonixSequence sequence = read_ultrasonix_file(file);
    EXPECT_EQ(sequence.header.frames, 6);
    EXPECT_EQ(sequence.header.ulx, 1);
    EXPECT_EQ(sequence.header.bly, 8);
    EXPECT_EQ(sequence.header.probe, 21);
    EXPECT_EQ(sequence.header.txf, 5'000'000);
    EXPECT_EQ(sequence.header.sf, 2'500'000);
    EXPECT_EQ(sequence.header.ld, 128);
    ASSERT_EQ(sequence.voxels.size(), 72U);
    EXPECT_EQ(sequence.voxels[0], 0);
    EXPECT_EQ(sequence.voxels[12], 20);
    EXPECT_EQ(sequence.voxels[71], 111);
    EXPECT_EQ(sequence.frame_tags, tags ? (std::vector<std::int32_t>{100, 101, 102, 103, 104, 105})
                                        : std::vector<std::int32_t>{});
  }
}

TEST(Ultrasonix, OneSweepBecomesAPreScanVolume) {
  const PreScanVolume volume =
      to_prescan(read_ultrasonix_file({}), linear_probe(), SweepSelection{}, "frames.bpr");
  EXPECT_EQ(volume.geometry.samples(), 4);
  EXPECT_EQ(volume.geometry.lines(), 3);
  EXPECT_EQ(volume.geometry.frames(), 6);
  EXPECT_NEAR(volume.geometry.axial.spacing_mm, 0.308, 1e-12);  // 1540 m/s, 2.5 MHz
  EXPECT_EQ(volume.at(3, 1, 2), 40 + 4 + 3);                    // samples of a line are contiguous
  const auto& sweep = std::get<MotorSweep>(volume.geometry.motion);
  EXPECT_NEAR(sweep.frame_angles_rad[0], -0.025, 1e-15);  // 2 steps of 5 mrad, centred
  EXPECT_NEAR(sweep.frame_angles_rad[5], 0.025, 1e-15);
  EXPECT_EQ(sweep.frame_travel_rad, 0.001);
}

TEST(Ultrasonix, SweepsAlternateDirection) {
  const UltrasonixSequence sequence = read_ultrasonix_file({});
  const auto sweep = [&](int index, bool first_backward) {
    return to_prescan(sequence, linear_probe(), SweepSelection{index, 2, first_backward},
                      "frames.bpr");
  };
  const auto first_angle = [](const PreScanVolume& volume) {
    return std::get<MotorSweep>(volume.geometry.motion).frame_angles_rad[0];
  };
  EXPECT_NEAR(first_angle(sweep(0, false)), -0.005, 1e-15);
  EXPECT_NEAR(first_angle(sweep(1, false)), 0.005, 1e-15);
  EXPECT_NEAR(first_angle(sweep(2, false)), -0.005, 1e-15);
  EXPECT_NEAR(first_angle(sweep(0, true)), 0.005, 1e-15);
  EXPECT_EQ(std::get<MotorSweep>(sweep(1, false).geometry.motion).frame_travel_rad, -0.001);
  // Frames stay in the order of recording.
  EXPECT_EQ(sweep(1, false).at(0, 0, 0), 40);
  EXPECT_EQ(sweep(1, false).at(0, 0, 1), 60);
  expect_input_error([&] { sweep(3, false); }, {"frames.bpr", "3 sweeps", "number 3"});
  expect_input_error([&] { sweep(-1, false); }, {"frames.bpr", "-1"});
  expect_input_error(
      [&] {
        to_prescan(sequence, linear_probe(), SweepSelection{0, 7, false}, "frames.bpr");
      },
      {"frames.bpr", "6 frames", "7"});
  // With a wrong number, each sweep would take frames of its neighbours at wrong angles.
  for (const int wrong : {4, 5})
    expect_input_error(
        [&] {
          to_prescan(sequence, linear_probe(), SweepSelection{0, wrong, false}, "frames.bpr");
        },
        {"frames.bpr", "6 frames", "'frames_per_sweep' is " + std::to_string(wrong), "divide"});
}

TEST(Ultrasonix, TrackedFramesGetTheirPoses) {
  ProbeConfig tracked = linear_probe();
  tracked.motor.reset();
  const TrackedSweep sweep{std::vector<Eigen::Isometry3d>(6, Eigen::Isometry3d::Identity()), {}};
  const PreScanVolume volume = to_prescan(read_ultrasonix_file({}), tracked, sweep, "frames.bpr");
  EXPECT_FALSE(volume.geometry.is_motorised());
  EXPECT_EQ(volume.at(3, 1, 2), 40 + 4 + 3);
}

TEST(Ultrasonix, ASamplingFrequencyThatCannotBeIsNotBelieved) {
  // Some software does not set the field.
  UltrasonixFile file;
  file.sf = -858993460;
  expect_input_error(
      [&] {
        to_prescan(read_ultrasonix_file(file), linear_probe(), SweepSelection{}, "frames.bpr");
      },
      {"frames.bpr", "sf", "-858993460"});
  ProbeConfig with_spacing = linear_probe();
  with_spacing.sampling.sample_spacing_mm = 0.2;
  EXPECT_EQ(to_prescan(read_ultrasonix_file(file), with_spacing, SweepSelection{}, "frames.bpr")
                .geometry.axial.spacing_mm,
            0.2);
}

TEST(Ultrasonix, NamesTheTypesThatItDoesNotRead) {
  const auto refuse = [](std::int32_t type, const std::string& name) {
    UltrasonixFile file;
    file.type = type;
    expect_input_error([&] { read_ultrasonix_file(file); },
                       {"frames.bpr", "type", std::to_string(type), name, ".bpr"});
  };
  refuse(8, "32 bit (.b32)");
  refuse(16, "RF (.rf)");
  refuse(32, "M before scan conversion");
  refuse(0x800, "colour velocity");
  refuse(0x8000, "elastography");
  refuse(3, "unknown");
  refuse(0, "unknown");
  refuse(-2, "unknown");
  UltrasonixFile post;
  post.type = 4;
  EXPECT_EQ(read_ultrasonix_file(post).voxels.size(), 72U);
  expect_input_error(
      [&] {
        to_prescan(read_ultrasonix_file(post), linear_probe(), SweepSelection{}, "frames.b8");
      },
      {"frames.b8", "type", "after scan conversion"});
}

TEST(Ultrasonix, RefusesSizesThatTheFileDoesNotBear) {
  const auto refuse = [](UltrasonixFile file, std::initializer_list<std::string> fragments) {
    expect_input_error([&] { read_ultrasonix_file(file); }, fragments);
  };
  UltrasonixFile file;
  file.frames = 7;
  refuse(file, {"72 bytes", "84", "112 with frame tags"});
  file = {}, file.frames = 0, refuse(file, {"frames", "0", ">= 1"});
  file = {}, file.frames = -1, refuse(file, {"frames", "-1", ">= 1"});
  file = {}, file.w = -3, refuse(file, {"w", "-3", ">= 1"});
  file = {}, file.h = 0, refuse(file, {"h", "0", ">= 1"});
  file = {}, file.ss = 16, refuse(file, {"ss", "16", "8"});
  // These products overflow 32 or 64 bits.
  file = {}, file.w = kMaxInt32, file.h = kMaxInt32, refuse(file, {"too large"});
  file = {}, file.w = 65536, file.h = 65536, refuse(file, {"65536"});
  file = {}, file.w = kMaxInt32, file.h = kMaxInt32, file.frames = kMaxInt32,
  refuse(file, {"too large"});
}

TEST(Ultrasonix, RefusesBrokenFiles) {
  const auto read_path = [](const std::filesystem::path& path) { read_ultrasonix(path); };
  test::expect_refuses_broken_files(read_path, UltrasonixFile{}.bytes(), ".bpr");
}

TEST(Ultrasonix, WritesTheSameBytes) {
  const TemporaryFolder folder;
  for (const bool tags : {false, true}) {
    UltrasonixFile file;
    file.tags = tags;
    write_ultrasonix(read_ultrasonix_file(file), folder.path() / "out.bpr");
    EXPECT_EQ(test::slurp(folder.path() / "out.bpr"), file.bytes());
  }
  std::filesystem::remove(folder.path() / "out.bpr");
  UltrasonixSequence sequence = read_ultrasonix_file({});
  sequence.voxels.pop_back();
  expect_input_error([&] { write_ultrasonix(sequence, folder.path() / "out.bpr"); }, {"out.bpr"});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Ultrasonix, IsToldApartFromOtherFiles) {
  const TemporaryFolder folder;
  EXPECT_TRUE(is_ultrasonix(spit(folder.path() / "a.bpr", UltrasonixFile{}.bytes())));
  test::FileBytes longer = UltrasonixFile{}.bytes();
  longer.push_back(0);
  EXPECT_FALSE(is_ultrasonix(spit(folder.path() / "a.bpr", longer)));
  EXPECT_FALSE(is_ultrasonix(folder.path() / "none.bpr"));
}

}  // namespace
}  // namespace usct
