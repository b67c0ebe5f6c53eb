#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/tools/run_usct.h"
#include "test_paths.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"

namespace usct {
namespace {

using test::Outcome;
using test::run_usct;
using test::TemporaryFolder;

/// Nine noisy sweeps over wires 25 mm apart by a motor that is slow before frame 40.
std::filesystem::path write_wires(const std::filesystem::path& folder) {
  std::mt19937 generator(5);
  std::normal_distribution<double> noise(0.0, 0.03);
  std::ofstream csv(folder / "wires.csv");
  csv << "volume,frame,distance_mm\n";
  for (int volume = 0; volume < 9; ++volume)
    for (int frame = 0; frame < 81; ++frame) {
      const double angle = (frame - 40) * (frame < 40 ? 0.611 : 0.747) * kDegree;
      csv << volume << "," << frame << "," << 25.0 / std::cos(angle) + noise(generator) << "\n";
    }
  return folder / "wires.csv";
}

std::string probe_yaml(const std::string& name) {
  return std::string(USCT_SOURCE_DIR) + "/config/probes/" + name;
}

TEST(CalibrateMotor, WritesAProbeWithTheMeasuredAngles) {
  const TemporaryFolder folder;
  const std::filesystem::path output = folder.path() / "calibrated.yaml";
  const Outcome outcome =
      run_usct({"calibrate-motor", "--wire-distances", write_wires(folder.path()).string(),
                "--true-distance-mm", "25", "--probe", probe_yaml("4dc7-3_40.yaml"), "--output",
                output.string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_NE(outcome.output.find("before it: 0.61"), std::string::npos) << outcome.output;
  EXPECT_NE(outcome.output.find("after it: 0.74"), std::string::npos) << outcome.output;
  const ProbeConfig before = read_probe_config(probe_yaml("4dc7-3_40.yaml"));
  const ProbeConfig after = read_probe_config(output);
  ASSERT_TRUE(after.motor);
  EXPECT_EQ(after.motor->motor_radius_mm, before.motor->motor_radius_mm);
  EXPECT_FALSE(after.motor->step_rad);
  ASSERT_EQ(after.motor->frame_angles_rad.size(), 81U);
  EXPECT_NEAR(after.motor->frame_angles_rad.front(), -40 * 0.611 * kDegree, 0.3 * kDegree);
  EXPECT_NEAR(after.motor->frame_angles_rad.back(), 40 * 0.747 * kDegree, 0.3 * kDegree);
}

/// The same wires, seen with a speed of sound that is 2 % too high by a sweep towards smaller
/// angles whose last nine frames show no wires.
TEST(CalibrateMotor, FollowsTheSweepThatItsOptionsDescribe) {
  const TemporaryFolder folder;
  const std::filesystem::path output = folder.path() / "calibrated.yaml";
  const Outcome outcome = run_usct(
      {"calibrate-motor", "--wire-distances", write_wires(folder.path()).string(),
       "--true-distance-mm", std::to_string(25.0 / 1.02), "--falling", "--fit-distance", "--frames",
       "90", "--probe", probe_yaml("4dc7-3_40.yaml"), "--output", output.string()});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  const std::size_t ratio = outcome.output.find(" mm, ");
  ASSERT_NE(ratio, std::string::npos) << outcome.output;
  EXPECT_NEAR(std::stod(outcome.output.substr(ratio + 5)), 1.02, 0.002);
  const ProbeConfig after = read_probe_config(output);
  ASSERT_EQ(after.motor->frame_angles_rad.size(), 90U);
  EXPECT_NEAR(after.motor->frame_angles_rad.front(), 40 * 0.611 * kDegree, 0.3 * kDegree);
  EXPECT_NEAR(after.motor->frame_angles_rad.back(), -49 * 0.747 * kDegree, 0.4 * kDegree);
}

TEST(CalibrateMotor, RefusesWithStatusTwoAndWritesNothing) {
  const TemporaryFolder folder;
  const std::string wires = write_wires(folder.path()).string();
  const std::filesystem::path output = folder.path() / "calibrated.yaml";
  const auto refused = [&](const std::string& distance, const std::string& probe) {
    const Outcome outcome =
        run_usct({"calibrate-motor", "--wire-distances", wires, "--true-distance-mm", distance,
                  "--probe", probe_yaml(probe), "--output", output.string()});
    EXPECT_EQ(outcome.exit_status, 2);
    EXPECT_FALSE(std::filesystem::exists(output));
    return outcome.errors;
  };
  EXPECT_NE(refused("27", "4dc7-3_40.yaml").find("below their true distance"), std::string::npos);
  EXPECT_NE(refused("25", "l9-4_38.yaml").find("must be motorised"), std::string::npos);
  const Outcome no_frames = run_usct({"calibrate-motor", "--wire-distances", wires,
                                      "--true-distance-mm", "25", "--frames", "0", "--probe",
                                      probe_yaml("4dc7-3_40.yaml"), "--output", output.string()});
  EXPECT_EQ(no_frames.exit_status, 2);
  EXPECT_NE(no_frames.errors.find("--frames: is 0, must be >= 2"), std::string::npos)
      << no_frames.errors;
}

}  // namespace
}  // namespace usct
