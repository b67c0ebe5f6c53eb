#include <gtest/gtest.h>

#include "core/io/bad_files.h"
#include "core/io/replaced.h"
#include "test_paths.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::replaced;
using test::spit;
using test::TemporaryFolder;

const std::filesystem::path kProbes = std::filesystem::path(USCT_SOURCE_DIR) / "config" / "probes";

const std::string kMotorised =
    "name: test\nkind: motorised_curvilinear\nprobe_radius_mm: 40\nlines: 3\nline_pitch_deg: 10\n"
    "motor_radius_mm: 27\nmotor_step_deg: 0.182925\nmotor_steps_per_frame: 4\n"
    "frame_travel_deg: 0.7\nstart_depth_mm: 1\nsample_spacing_mm: 0.3\n";
const std::string kLinear =
    "name: test\nkind: linear\nline_positions_mm: [-1, 0.5, 3]\nstart_depth_mm: 0\n";

ProbeConfig read_probe(const std::string& content) {
  const TemporaryFolder folder;
  return read_probe_config(spit(folder.path() / "probe.yaml", content));
}

RecordedFrames recorded(int frames) {
  RecordedFrames result;
  result.samples = 10;
  result.lines = 3;
  result.frames = frames;
  return result;
}

const MotorSweep& motor_of(const ScanGeometry& geometry) {
  return std::get<MotorSweep>(geometry.motion);
}

TEST(ProbeConfig, EveryShippedFileLoads) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kProbes)) {
    SCOPED_TRACE(entry.path());
    EXPECT_NO_THROW(read_probe_config(entry.path()));
    ++count;
  }
  EXPECT_GE(count, 4);
}

TEST(ProbeConfig, The4DC7IsAsPublished) {
  const ProbeConfig probe = read_probe_config(kProbes / "4dc7-3_40.yaml");
  const auto& array = std::get<CurvilinearArray>(probe.array);
  EXPECT_EQ(array.probe_radius_mm, 40.0);
  ASSERT_EQ(array.line_angles_rad.size(), 128U);
  EXPECT_NEAR(array.line_angles_rad[1] - array.line_angles_rad[0], 0.010625, 1e-14);
  EXPECT_NEAR(array.line_angles_rad[0], -63.5 * 0.010625, 1e-13);
  RecordedFrames frames;
  frames.samples = 260;
  frames.lines = 128;
  frames.frames = 97;
  frames.sampling_frequency_hz = 2.5e6;  // the thesis' setting
  const ScanGeometry geometry = motorised_geometry(probe, frames, "test");
  EXPECT_NEAR(geometry.axial.spacing_mm, 0.308, 1e-12);
  EXPECT_EQ(motor_of(geometry).motor_radius_mm, 27.25);
  const std::vector<double>& angles = motor_of(geometry).frame_angles_rad;
  EXPECT_NEAR(angles[1] - angles[0], 0.7317 * kDegree, 1e-12);
  EXPECT_NEAR(angles.front() + angles.back(), 0.0, 1e-12);
}

TEST(ProbeConfig, TheGeometryOfThePlusConfigurations) {
  const auto curved =
      std::get<CurvilinearArray>(read_probe_config(kProbes / "bpc8-4_10.yaml").array);
  EXPECT_NEAR(curved.line_angles_rad.front(), -75.0 * kDegree, 1e-12);
  EXPECT_NEAR(curved.line_angles_rad.back(), 75.0 * kDegree, 1e-12);
  const auto linear = std::get<LinearArray>(read_probe_config(kProbes / "l9-4_38.yaml").array);
  EXPECT_NEAR(linear.line_positions_mm.back() - linear.line_positions_mm.front(), 38.0 * 127 / 128,
              1e-12);
}

TEST(ProbeConfig, NamesTheKeyThatIsWrong) {
  const auto refuse = [](const std::string& content, std::initializer_list<std::string> fragments) {
    SCOPED_TRACE(content);
    expect_input_error([&] { read_probe(content); }, fragments);
  };
  refuse(kMotorised + "sample_spacing: 3\n", {"probe.yaml", "sample_spacing", "unknown"});
  refuse(kMotorised + "line_positions_mm: [1, 2]\n", {"line_positions_mm", "not one of this kind"});
  refuse(kLinear + "motor_radius_mm: 3\n", {"motor_radius_mm", "not one of this kind"});
  refuse(kMotorised + "lines: 3\n", {"lines", "twice"});
  refuse(replaced(kMotorised, "start_depth_mm: 1\n", ""), {"start_depth_mm", "missing"});
  refuse(replaced(kMotorised, "name: test\n", ""), {"name", "missing"});
  refuse(replaced(kMotorised, "motor_radius_mm: 27", "motor_radius_mm: [27]"),
         {"motor_radius_mm", "single"});
  refuse(replaced(kMotorised, "motor_radius_mm: 27", "motor_radius_mm: wide"),
         {"motor_radius_mm", "wide"});
  refuse(replaced(kMotorised, "motor_radius_mm: 27", "motor_radius_mm: .nan"),
         {"motor_radius_mm", "finite"});
  refuse(replaced(kMotorised, "motor_radius_mm: 27", "motor_radius_mm: -27"),
         {"motor_radius_mm", "-27"});
  refuse(replaced(kMotorised, "lines: 3", "lines: 2000000000"), {"lines", "2000000000", "65536"});
  refuse(replaced(kMotorised, "lines: 3", "lines: 3.5"), {"lines", "3.5", "whole"});
  refuse(replaced(kMotorised, "line_pitch_deg: 10", "line_pitch_deg: 0"), {"line_angles"});
  refuse(replaced(kMotorised, "line_pitch_deg: 10", "line_pitch_deg: 100"), {"line_angles", "90"});
  refuse(kMotorised + "line_angles_deg: [1, 2, 3]\n",
         {"line_angles_deg", "line_pitch_deg", "both"});
  refuse(replaced(kMotorised, "line_pitch_deg: 10\n", ""),
         {"line_angles_deg", "line_pitch_deg", "neither"});
  refuse(kMotorised + "frame_angles_deg: [1, 2, 3]\n", {"motor_step_deg", "frame_angles_deg"});
  refuse(replaced(kMotorised, "motor_step_deg: 0.182925\n", ""),
         {"motor_step_deg", "frame_angles_deg"});
  refuse(replaced(kMotorised, "per_frame: 4", "per_frame: 0"),
         {"motor_steps_per_frame", "0", ">= 1"});
  refuse(replaced(kMotorised, "travel_deg: 0.7", "travel_deg: -1"),
         {"frame_travel_deg", "-1", ">= 0"});
  refuse(kMotorised + "imaging_depth_mm: 80\n", {"imaging_depth_mm", "at most one"});
  refuse(kLinear + "sampling_frequency_hz: 1e7\n",
         {"sampling_frequency_hz", "speed_of_sound_m_per_s"});
  refuse(replaced(kLinear, "linear", "phased"), {"kind", "phased"});
  refuse(replaced(kLinear, "[-1, 0.5, 3]", "[-1, 0.5, x]"), {"line_positions_mm", "x"});
  refuse(replaced(kLinear, "[-1, 0.5, 3]", "[-1, [2], 3]"), {"line_positions_mm", "list"});
  refuse(replaced(kLinear, "[-1, 0.5, 3]", "[-1, 3, 0]"), {"line_positions_mm"});
  refuse("- 1\n- 2\n", {"key: value"});
  refuse("a: [", {"YAML"});
}

TEST(ProbeConfig, RefusesBrokenFiles) {
  test::expect_refuses_broken_files(
      [](const auto& path) { read_probe_config(path); },
      // The text ends without a line end, so that any shorter text differs.
      test::to_bytes("name: t\nkind: linear\nstart_depth_mm: 0\n"
                     "line_positions_mm: [-1, 0.5, 3]"),
      ".yaml");
}

TEST(ProbeConfig, EveryWayToSayTheSampleSpacing) {
  const auto spacing = [](const std::string& keys, std::optional<double> file_frequency) {
    RecordedFrames frames = recorded(1);
    frames.sampling_frequency_hz = file_frequency;
    return tracked_geometry(read_probe(kLinear + keys), frames,
                            TrackedSweep{{Eigen::Isometry3d::Identity()}, {}}, "file.bpr")
        .axial.spacing_mm;
  };
  EXPECT_EQ(spacing("sample_spacing_mm: 0.3\n", {}), 0.3);
  EXPECT_NEAR(spacing("imaging_depth_mm: 5\n", {}), 0.5, 1e-15);  // 10 samples
  EXPECT_NEAR(spacing("sampling_frequency_hz: 2.5e6\nspeed_of_sound_m_per_s: 1540\n", {}), 0.308,
              1e-15);
  EXPECT_NEAR(spacing("speed_of_sound_m_per_s: 1500\n", 7.5e6), 0.1, 1e-15);
  expect_input_error([&] { spacing("", {}); }, {"file.bpr", "sample_spacing_mm"});
  expect_input_error([&] { spacing("", 2.5e6); }, {"file.bpr", "speed_of_sound_m_per_s"});
}

TEST(ProbeConfig, RecoversTheExactStepFromATruncatedOne) {
  const ProbeConfig open = read_probe(replaced(kMotorised, "motor_steps_per_frame: 4\n", ""));
  const auto pitch = [&](const ProbeConfig& probe, int millidegrees) {
    RecordedFrames frames = recorded(5);
    frames.frame_pitch_millidegrees = millidegrees;
    const std::vector<double> angles =
        motor_of(motorised_geometry(probe, frames, "file.vol")).frame_angles_rad;
    return (angles[1] - angles[0]) / kDegree;
  };
  EXPECT_NEAR(pitch(open, 731), 0.7317, 1e-12);
  EXPECT_NEAR(pitch(open, 1463), 1.4634, 1e-12);
  EXPECT_NEAR(pitch(open, 182), 0.182925, 1e-12);
  EXPECT_NEAR(pitch(read_probe(kMotorised), 731), 0.7317, 1e-12);
  expect_input_error([&] { pitch(open, 732); }, {"file.vol", "732", "whole number of motor steps"});
  expect_input_error([&] { pitch(open, 0); }, {"file.vol", "0", "whole number of motor steps"});
  expect_input_error([&] { pitch(read_probe(kMotorised), 1463); },
                     {"file.vol", "1463", "731", "4 motor steps"});
  expect_input_error([&] { motorised_geometry(open, recorded(5), "file.bpr"); },
                     {"file.bpr", "motor_steps_per_frame"});
}

ProbeConfig calibrated() {
  std::string text = replaced(kMotorised, "motor_step_deg: 0.182925\nmotor_steps_per_frame: 4\n",
                              "frame_angles_deg: [-1.2, -0.6, 0, 0.75, 1.5]\n");
  return read_probe(text);
}

TEST(ProbeConfig, ACalibratedTableRulesOverTheNominalStep) {
  RecordedFrames frames = recorded(5);
  frames.frame_pitch_millidegrees = 731;  // the mean of the table is 675
  const MotorSweep sweep = motor_of(motorised_geometry(calibrated(), frames, "file.vol"));
  EXPECT_NEAR(sweep.frame_angles_rad[1], -0.6 * kDegree, 1e-15);
  EXPECT_NEAR(sweep.frame_angles_rad[3], 0.75 * kDegree, 1e-15);
  EXPECT_NEAR(sweep.frame_travel_rad, 0.7 * kDegree, 1e-15);
  frames.frame_pitch_millidegrees = 1463;  // another number of motor steps per frame
  expect_input_error([&] { motorised_geometry(calibrated(), frames, "file.vol"); },
                     {"file.vol", "1463", "25 %", "675"});
  expect_input_error([&] { motorised_geometry(calibrated(), recorded(6), "file.vol"); },
                     {"file.vol", "6", "frame_angles_deg", "5"});
}

TEST(ProbeConfig, ABackwardSweepHasItsAnglesReversedAndTravelsBack) {
  RecordedFrames frames = recorded(5);
  frames.backward = true;
  const MotorSweep sweep = motor_of(motorised_geometry(calibrated(), frames, "test"));
  EXPECT_NEAR(sweep.frame_angles_rad.front(), 1.5 * kDegree, 1e-15);
  EXPECT_NEAR(sweep.frame_angles_rad[1], 0.75 * kDegree, 1e-15);
  EXPECT_NEAR(sweep.frame_angles_rad.back(), -1.2 * kDegree, 1e-15);
  EXPECT_NEAR(sweep.frame_travel_rad, -0.7 * kDegree, 1e-15);
}

TEST(ProbeConfig, AProbeFitsItsData) {
  RecordedFrames frames = recorded(5);
  frames.lines = 4;
  expect_input_error([&] { motorised_geometry(read_probe(kMotorised), frames, "file"); },
                     {"file", "4", "3"});
  const TrackedSweep one{{Eigen::Isometry3d::Identity()}, {}};
  expect_input_error([&] { tracked_geometry(read_probe(kMotorised), recorded(1), one, "file"); },
                     {"motor"});
  expect_input_error([&] { motorised_geometry(read_probe(kLinear), recorded(5), "file"); },
                     {"no motor"});
  expect_input_error(
      [&] {
        tracked_geometry(read_probe(kLinear + "sample_spacing_mm: 1\n"), recorded(2), one, "file");
      },
      {"file", "2 frames", "1 poses"});
}

TEST(ProbeConfig, WhatIsWrittenComesBack) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "out.yaml";
  ProbeConfig probe = calibrated();
  probe.name = "odd: name # \"quoted\"";
  write_probe_config(probe, path);
  const ProbeConfig back = read_probe_config(path);
  EXPECT_EQ(back.name, probe.name);
  ASSERT_TRUE(back.motor.has_value());
  ASSERT_EQ(back.motor->frame_angles_rad.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_NEAR(back.motor->frame_angles_rad[i], probe.motor->frame_angles_rad[i], 1e-15);
  EXPECT_NEAR(back.motor->frame_travel_rad, probe.motor->frame_travel_rad, 1e-15);
  EXPECT_EQ(back.motor->motor_radius_mm, 27.0);
  EXPECT_EQ(back.sampling.sample_spacing_mm, 0.3);
  EXPECT_EQ(back.sampling.start_depth_mm, 1.0);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(std::get<CurvilinearArray>(back.array).line_angles_rad[i],
                (static_cast<double>(i) - 1.0) * 10.0 * kDegree, 1e-12);
  // Evenly spaced lines stay readable, uneven ones stay exact.
  const test::FileBytes even = test::slurp(path);
  EXPECT_NE(std::string(even.begin(), even.end()).find("line_pitch_deg: "), std::string::npos);
  write_probe_config(read_probe(kLinear), path);
  EXPECT_EQ(std::get<LinearArray>(read_probe_config(path).array).line_positions_mm,
            (std::vector<double>{-1.0, 0.5, 3.0}));
  for (const auto& entry : std::filesystem::directory_iterator(kProbes)) {
    write_probe_config(read_probe_config(entry.path()), path);
    EXPECT_NO_THROW(read_probe_config(path)) << entry.path();
  }
}

TEST(ProbeConfig, AnInvalidProbeIsNotWritten) {
  const TemporaryFolder folder;
  ProbeConfig probe = calibrated();
  probe.motor->frame_angles_rad[1] = probe.motor->frame_angles_rad[3];
  expect_input_error([&] { write_probe_config(probe, folder.path() / "out.yaml"); },
                     {"out.yaml", "frame_angles"});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace usct
