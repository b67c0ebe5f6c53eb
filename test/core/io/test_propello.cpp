#include <gtest/gtest.h>

#include <limits>

#include "core/io/bad_files.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/ultrasound/propello.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::spit;
using test::TemporaryFolder;

constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();

/// A file made from the published layout, byte by byte, not by our writer.
struct File {
  std::int32_t type = 0, volumes = 3, fpv = 2, w = 3, h = 4, ss = 8, degPerFr = 731;

  test::FileBytes bytes() const {
    test::FileBytes result;
    for (const std::int32_t value : {type, volumes, fpv, w, h, ss, degPerFr})
      test::append_int32(result, value);
    for (int i = 0; i < 3 * 2 * 3 * 4; ++i) result.push_back(static_cast<std::uint8_t>(i));
    return result;
  }
};

PropelloVolumes read_propello_file(const File& file) {
  const TemporaryFolder folder;
  return read_propello(spit(folder.path() / "sweeps.vol", file.bytes()));
}

ProbeConfig probe() {
  ProbeConfig config;
  config.array = CurvilinearArray{40.0, {-0.1, 0.0, 0.1}};
  config.motor = ProbeMotor{27.25, 0.182925 * kDegree, {}, {}, 0.01};
  config.sampling.sample_spacing_mm = 0.308;
  return config;
}

TEST(Propello, AVolumeBecomesAPreScanVolume) {
  const PreScanVolume volume = to_prescan(read_propello_file({}), probe(), 0, false, "sweeps.vol");
  EXPECT_EQ(volume.geometry.samples(), 4);
  EXPECT_EQ(volume.geometry.lines(), 3);
  EXPECT_EQ(volume.geometry.frames(), 2);
  EXPECT_EQ(volume.at(1, 2, 1), 12 + 2 * 4 + 1);
  const auto& sweep = std::get<MotorSweep>(volume.geometry.motion);
  // 731 is 4 steps of 0.182925 degrees, truncated: the reader restores the lost 0.7 thousandths.
  EXPECT_NEAR(sweep.frame_angles_rad[1] - sweep.frame_angles_rad[0], 0.7317 * kDegree, 1e-14);
  EXPECT_EQ(sweep.frame_travel_rad, 0.01);
}

TEST(Propello, VolumesAlternateDirection) {
  const PropelloVolumes volumes = read_propello_file({});
  const auto rises = [&](int volume, bool first_backward) {
    const PreScanVolume result = to_prescan(volumes, probe(), volume, first_backward, "sweeps.vol");
    const auto& sweep = std::get<MotorSweep>(result.geometry.motion);
    EXPECT_EQ(result.at(0, 0, 0), 24 * volume);  // frames stay in the order of recording
    EXPECT_EQ(sweep.frame_travel_rad > 0, sweep.frame_angles_rad[1] > sweep.frame_angles_rad[0]);
    return sweep.frame_angles_rad[1] > sweep.frame_angles_rad[0];
  };
  EXPECT_TRUE(rises(0, false));
  EXPECT_FALSE(rises(1, false));
  EXPECT_TRUE(rises(2, false));
  EXPECT_FALSE(rises(0, true));
  EXPECT_TRUE(rises(1, true));
  for (const int volume : {-1, 3})
    expect_input_error([&] { to_prescan(volumes, probe(), volume, false, "sweeps.vol"); },
                       {"sweeps.vol", "3 volumes", std::to_string(volume)});
}

TEST(Propello, APitchThatContradictsTheProbeIsNamed) {
  ProbeConfig eight = probe();
  eight.motor->steps_per_frame = 8;
  expect_input_error([&] { to_prescan(read_propello_file({}), eight, 0, false, "sweeps.vol"); },
                     {"sweeps.vol", "731", "1463", "8 motor steps"});
}

TEST(Propello, NamesTheTypesThatItDoesNotRead) {
  const auto refuse = [](std::int32_t type, const std::string& name) {
    File file;
    file.type = type;
    expect_input_error([&] { read_propello_file(file); },
                       {"sweeps.vol", "type", std::to_string(type), name});
  };
  refuse(2, "RF");
  refuse(3, "colour velocity");
  refuse(4, "colour after scan conversion");
  refuse(5, "unknown");
  refuse(-1, "unknown");
  File post;
  post.type = 1;
  EXPECT_EQ(read_propello_file(post).voxels.size(), 72U);
  expect_input_error([&] { to_prescan(read_propello_file(post), probe(), 0, false, "sweeps.vol"); },
                     {"sweeps.vol", "type", "after scan conversion"});
}

TEST(Propello, RefusesSizesThatTheFileDoesNotBear) {
  const auto refuse = [](File file, std::initializer_list<std::string> fragments) {
    expect_input_error([&] { read_propello_file(file); }, fragments);
  };
  File file;
  file.volumes = 4;
  refuse(file, {"72 bytes", "4 volumes", "96"});
  file = {}, file.volumes = 2, refuse(file, {"72 bytes", "48"});
  file = {}, file.volumes = 0, refuse(file, {"volumes", "0", ">= 1"});
  file = {}, file.fpv = -2, refuse(file, {"fpv", "-2", ">= 1"});
  file = {}, file.w = 0, refuse(file, {"'w'", "0", ">= 1"});
  file = {}, file.h = -4, refuse(file, {"'h'", "-4", ">= 1"});
  file = {}, file.ss = 16, refuse(file, {"ss", "16", "8"});
  file = {}, file.degPerFr = -731, refuse(file, {"degPerFr", "-731"});
  file = {}, file.degPerFr = kMax, refuse(file, {"degPerFr"});
  // These products overflow 32 or 64 bits.
  file = {}, file.w = 65536, file.h = 65536, refuse(file, {"65536"});
  file = {}, file.volumes = file.fpv = file.w = file.h = kMax, refuse(file, {"too large"});
  file = {}, file.volumes = file.fpv = file.w = file.h = 65536, refuse(file, {"too large"});
}

TEST(Propello, RefusesBrokenFiles) {
  const auto read_path = [](const std::filesystem::path& path) { read_propello(path); };
  test::expect_refuses_broken_files(read_path, File{}.bytes(), ".vol");
}

TEST(Propello, WritesTheSameBytes) {
  const TemporaryFolder folder;
  write_propello(read_propello_file({}), folder.path() / "out.vol");
  EXPECT_EQ(test::slurp(folder.path() / "out.vol"), File{}.bytes());
  EXPECT_TRUE(is_propello(folder.path() / "out.vol"));
  std::filesystem::remove(folder.path() / "out.vol");
  PropelloVolumes volumes = read_propello_file({});
  volumes.voxels.pop_back();
  expect_input_error([&] { write_propello(volumes, folder.path() / "out.vol"); }, {"out.vol"});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

/// Scanners truncate the angle, and so must the writer: rounded, 0.7317 degrees would be 732.
TEST(Propello, AWrittenSweepIsReadBackAtItsAngles) {
  const TemporaryFolder folder;
  const PreScanVolume volume = to_prescan(read_propello_file({}), probe(), 0, false, "sweeps.vol");
  write_propello_beams(volume, folder.path() / "out.vol");
  const PropelloVolumes written = read_propello(folder.path() / "out.vol");
  EXPECT_EQ(written.header.degPerFr, 731);
  ProbeConfig four = probe();
  four.motor->steps_per_frame = 4;
  for (const ProbeConfig& config : {probe(), four}) {
    const PreScanVolume back = to_prescan(written, config, 0, false, "out.vol");
    const auto angles_rad = [](const PreScanVolume& one) {
      return std::get<MotorSweep>(one.geometry.motion).frame_angles_rad;
    };
    EXPECT_EQ(angles_rad(back), angles_rad(volume));
    EXPECT_EQ(back.voxels, volume.voxels);
  }
}

}  // namespace
}  // namespace usct
