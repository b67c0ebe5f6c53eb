#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/simulation/simple_scenes.h"
#include "core/tools/run_usct.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/monotonic_table.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::test {
namespace {

/// A ball of 150 HU in 0 HU at the origin of the CT, which lies at (10, 80, -5) mm of the US frame,
/// and ultrasound in which it is bright.
class SimulateCommand : public testing::Test {
 protected:
  void SetUp() override {
    write_volume(ct_of(centred_grid(61, 1.5),
                       [](const Eigen::Vector3d& p) { return p.norm() < kRadiusMm ? 150.0 : 0.0; }),
                 path("ct.nrrd"));
    T_us_ct_.translation() = Eigen::Vector3d(10.0, 80.0, -5.0);
    write_T_us_ct(T_us_ct_, path("truth.tfm"));
    us_.geometry.axial = {60, 0.0, 1.2};
    us_.geometry.array = CurvilinearArray{40.0, centred_table(32, 0.03)};
    us_.geometry.motion = MotorSweep{27.25, centred_table(21, 0.04), 0.0};
    const BeamGrid beams = beam_grid(us_.geometry);
    for (int f = 0; f < 21; ++f)
      for (int l = 0; l < 32; ++l)
        for (int s = 0; s < 60; ++s) us_.voxels.push_back(in_ball(beams.point(f, l, s)) ? 160 : 60);
    write_prescan_nrrd(us_, path("us.nrrd"));
  }

  bool in_ball(const Eigen::Vector3d& p_us) const {
    return (T_us_ct_.inverse() * p_us).norm() < kRadiusMm;
  }
  /// Depths at which a beam enters the ball and leaves it.
  std::pair<double, double> surfaces_mm(int line, int frame) const {
    const BeamGrid beams = beam_grid(us_.geometry);
    int first = -1;
    int last = -1;
    for (int s = 0; s < beams.samples(); ++s)
      if (in_ball(beams.point(frame, line, s))) {
        if (first < 0) first = s;
        last = s;
      }
    return {1.2 * first, 1.2 * last};
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  Outcome simulate(std::vector<std::string> more) const {
    std::vector<std::string> arguments{"simulate",      "--ct",     path("ct.nrrd"), "--us",
                                       path("us.nrrd"), "--output", path("out")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  }
  nlohmann::json summary() const {
    return nlohmann::json::parse(read_text(path("out/simulation.json")));
  }

  static constexpr double kRadiusMm = 18.0;
  TemporaryFolder folder_;
  Eigen::Isometry3d T_us_ct_ = Eigen::Isometry3d::Identity();
  PreScanVolume us_;
};

TEST_F(SimulateCommand, ExplainsTheUltrasoundAtTheTruthAndWritesEveryImage) {
  const Outcome outcome = simulate({"--transform", path("truth.tfm"), "--no-auto-depth"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  const nlohmann::json json = summary();
  EXPECT_EQ(json["status"], "fitted");
  EXPECT_GT(json["lc2"], 0.85);
  // p is 135 in the ball and 0 around it, the ultrasound 160 and 60.
  EXPECT_NEAR(json["weight_mapped_ct"], 100.0 / 135.0, 0.08);
  EXPECT_NEAR(json["bias"], 60.0, 2.0);
  for (const char* name : {"ultrasound", "ct", "gradient", "reflection", "intensity", "mapped_ct",
                           "simulated", "conditioned", "flags", "excluded"})
    EXPECT_EQ(read_prescan_nrrd(path("out/" + std::string(name) + ".nrrd")).geometry.frames(), 21)
        << name;
  // The simulated ultrasound is bright where the ball is.
  const PreScanVolume simulated = read_prescan_nrrd(path("out/simulated.nrrd"));
  const BeamGrid beams = beam_grid(simulated.geometry);
  int wrong = 0;
  for (int s = 0; s < 60; ++s)
    wrong += (simulated.at(s, 20, 8) > 110) != in_ball(beams.point(8, 20, s)) ? 1 : 0;
  EXPECT_LE(wrong, 4);  // at the two edges
  EXPECT_TRUE(std::filesystem::exists(path("out/frame.png")));
  EXPECT_TRUE(std::filesystem::exists(path("out/frame_beams.png")));
  EXPECT_NE(outcome.output.find("LC2"), std::string::npos);
}

/// The bytes and simulation.json give the values back: half a step of 255 is what rounding loses.
TEST_F(SimulateCommand, SignedAndUnlimitedValuesAreKept) {
  const auto value = [&](const std::string& name, int sample) {
    const nlohmann::json range = summary()["images"][name];
    const double black = range["black"];
    const double white = range["white"];
    const int grey = read_prescan_nrrd(path("out/" + name + ".nrrd")).at(sample, 16, 10);
    return black + (white - black) * grey / 255.0;
  };
  // The samples of the middle beam at the ball's near and far surface, in it, and before it.
  const auto at = [](double depth_mm) { return static_cast<int>(std::lround(depth_mm / 1.2)); };
  ASSERT_EQ(
      simulate({"--transform", path("truth.tfm"), "--signed", "--no-clamp", "--no-auto-depth"})
          .exit_status,
      0);
  EXPECT_EQ(summary()["images"]["reflection"]["black"], -1.0);
  const auto extreme = [&](double depth_mm, double sign) {
    double most = -1.0;
    for (int s = at(depth_mm) - 4; s <= at(depth_mm) + 4; ++s)
      most = std::max(most, sign * value("reflection", s));
    return most;
  };
  const auto [first, last] = surfaces_mm(16, 10);
  EXPECT_GT(extreme(first, 1.0), 0.1);  // mu rises into the ball,
  EXPECT_GT(extreme(last, -1.0), 0.1);  // and falls behind it
  // mu is 1000 around the ball and 1150 in it.
  EXPECT_NEAR(value("mapped_ct", at(first) - 5), 1.36 * 1000.0 - 1429.0, 1.0);
  EXPECT_NEAR(value("mapped_ct", at(0.5 * (first + last))), 1.36 * 1150.0 - 1429.0, 1.0);
}

TEST_F(SimulateCommand, AWrongPoseExplainsLess) {
  Eigen::Isometry3d wrong = T_us_ct_;
  wrong.translation().x() += 12.0;
  write_T_us_ct(wrong, path("wrong.tfm"));
  ASSERT_EQ(simulate({"--transform", path("truth.tfm"), "--no-auto-depth"}).exit_status, 0);
  const double at_truth = summary()["lc2"];
  // Images of two poses must not lie beside each other in one folder.
  EXPECT_EQ(simulate({"--transform", path("wrong.tfm"), "--no-auto-depth"}).exit_status, 2);
  EXPECT_EQ(summary()["lc2"], at_truth);
  std::filesystem::remove_all(path("out"));
  ASSERT_EQ(simulate({"--transform", path("wrong.tfm"), "--no-auto-depth"}).exit_status, 0);
  EXPECT_LT(summary()["lc2"], at_truth - 0.2);
}

TEST_F(SimulateCommand, ParallelBeamsAreVariantA) {
  const Outcome outcome =
      simulate({"--transform", path("truth.tfm"), "--parallel-beams", "1.5", "--no-auto-depth"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_GT(summary()["lc2"], 0.8);
  EXPECT_GT(summary()["samples_excluded"]["unknown"], 0);
  const UsVolume simulated = read_volume<std::uint8_t>(path("out/simulated.nrrd"));
  const Eigen::Vector3d centre = T_us_ct_.translation();
  EXPECT_NEAR(sample(simulated, centre, Interpolation::kNearest, Outside::constant(0)), 160, 10);
  const Eigen::Vector3d above = centre - Eigen::Vector3d(0, kRadiusMm + 6.0, 0);
  EXPECT_NEAR(sample(simulated, above, Interpolation::kNearest, Outside::constant(0)), 60, 10);
}

TEST_F(SimulateCommand, FixedWeightsAreReported) {
  ASSERT_EQ(
      simulate({"--transform", path("truth.tfm"), "--weights", "0.5", "20", "-3"}).exit_status, 0);
  EXPECT_EQ(summary()["status"], "fixed weights");
  EXPECT_EQ(summary()["weight_reflection"], 20.0);
  EXPECT_EQ(summary()["bias"], -3.0);
}

TEST_F(SimulateCommand, NoOverlapEndsWithStatusThreeAndAReason) {
  Eigen::Isometry3d far = T_us_ct_;
  far.translation().z() += 500.0;
  write_T_us_ct(far, path("far.tfm"));
  const Outcome outcome = simulate({"--transform", path("far.tfm")});
  EXPECT_EQ(outcome.exit_status, 3);
  EXPECT_NE(outcome.output.find("no overlap"), std::string::npos);
  EXPECT_EQ(summary()["status"], "no overlap");
}

TEST_F(SimulateCommand, BadArgumentsAreNamed) {
  const auto expect_refused = [&](const std::vector<std::string>& more, const std::string& named) {
    const Outcome outcome = simulate(more);
    EXPECT_EQ(outcome.exit_status, 2) << named;
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  };
  expect_refused({"--frame", "21"}, "--frame");
  expect_refused({"--frame", "-1"}, "--frame: is -1, must be >= 0");
  expect_refused({"--log-compression", "both"}, "--log-compression");
  expect_refused({"--signed", "--log-compression", "intensity"}, "--signed: is given");
  expect_refused({"--gradient-length", "0"}, "gradient_length_mm");
  expect_refused({"--depth", "40", "20"}, "depth.min_mm");
  expect_refused({"--us-mask", path("ct.nrrd")}, "--us-mask");
  expect_refused({"--parallel-beams", "2", "--beam-axis", "y"}, "--beam-axis");
}

}  // namespace
}  // namespace usct::test
