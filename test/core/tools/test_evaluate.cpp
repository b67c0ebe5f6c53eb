#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/tools/run_usct.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"

namespace usct::test {
namespace {

/// Targets 30 and 50 mm from the z axis, a result 4 mm too far along x and a candidate turned by
/// 0.2 rad about z.
class Evaluate : public testing::Test {
 protected:
  Evaluate() {
    T_true_.linear() = Eigen::AngleAxisd(1.0, Eigen::Vector3d(3, -1, 2).normalized()).matrix();
    T_true_.translation() = Eigen::Vector3d(10, -20, 300);
    write_T_us_ct(T_true_, path("truth.tfm"));
    write_points_mm({{30, 0, 5}, {0, 50, -9}}, path("targets.csv"));
    result_.status = RegistrationStatus::kRegistered;
    result_.message = "ok";
    result_.T_us_ct = Eigen::Translation3d(4, 0, 0) * T_true_;
    const Eigen::Isometry3d T_turned(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()));
    result_.candidates = {{*result_.T_us_ct, 0.5, 0.9}, {T_turned * T_true_, 0.25, 0.75}};
  }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  Outcome evaluate(const std::vector<std::string>& more = {}) const {
    write_result(result_, path("result.json"));
    std::vector<std::string> arguments{"evaluate",         "--result",        path("result.json"),
                                       "--truth",          path("truth.tfm"), "--targets",
                                       path("targets.csv")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  }

  TemporaryFolder folder_;
  Eigen::Isometry3d T_true_ = Eigen::Isometry3d::Identity();
  RegistrationResult result_;
};

TEST_F(Evaluate, PrintsTheErrorsOfARegisteredResult) {
  const Outcome outcome = evaluate();
  EXPECT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(outcome.output,
            "targets: 2\nTRE, mm: mean 4.000, RMS 4.000, median 4.000, max 4.000\n");
}

// The second target was 8 mm further along z than the rigid truth says, and the result is 4 mm too
// far along x.
TEST_F(Evaluate, PrintsThePhysicalErrorIfTheTargetsInTheCtAreGiven) {
  const Eigen::Isometry3d T_ct_us = T_true_.inverse();
  write_points_mm({T_ct_us * Eigen::Vector3d(30, 0, 5), T_ct_us * Eigen::Vector3d(0, 50, -17)},
                  path("targets_ct.csv"));
  const std::vector<std::string> given{"--targets-ct", path("targets_ct.csv")};
  const Outcome outcome = evaluate(given);
  EXPECT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(outcome.output,
            "targets: 2\nTRE, mm: mean 4.000, RMS 4.000, median 4.000, max 4.000\n"
            "physical error, mm: mean 6.472, RMS 6.928, median 6.472, max 8.944\n");
  const auto json = nlohmann::json::parse(
      evaluate({"--targets-ct", path("targets_ct.csv"), "--json", "--candidates"}).output);
  EXPECT_NEAR(json["tre_mm"]["max"].get<double>(), 4.0, 1e-9);
  EXPECT_NEAR(json["physical_mm"]["rms"].get<double>(), std::sqrt(48.0), 1e-9);
  EXPECT_NEAR(json["physical_mm"]["per_target"][1].get<double>(), std::sqrt(80.0), 1e-9);
  EXPECT_NEAR(json["candidates"][0]["physical_mm"]["max"].get<double>(), std::sqrt(80.0), 1e-9);
  EXPECT_TRUE(nlohmann::json::parse(evaluate({"--json"}).output)["physical_mm"].is_null());

  write_points_mm({{1, 2, 3}}, path("targets_ct.csv"));
  const Outcome refused = evaluate(given);
  EXPECT_EQ(refused.exit_status, 2);
  EXPECT_NE(refused.errors.find("targets_ct.csv"), std::string::npos) << refused.errors;
  EXPECT_NE(refused.errors.find("has 1 points, must have as many as --targets, 2"),
            std::string::npos)
      << refused.errors;
}

TEST_F(Evaluate, JsonHasTheExpectedErrorsAndThoseOfCandidates) {
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance(2, 2) = 0.01 * 0.01;
  result_.covariance = covariance;
  const Outcome outcome = evaluate({"--candidates", "--json"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.errors;
  const auto json = nlohmann::json::parse(outcome.output);
  EXPECT_EQ(json["status"], "registered");
  EXPECT_EQ(json["targets"], 2);
  EXPECT_NEAR(json["tre_mm"]["rms"].get<double>(), 4.0, 1e-9);
  EXPECT_NEAR(json["tre_mm"]["per_target"][1].get<double>(), 4.0, 1e-9);
  EXPECT_NEAR(json["expected_tre_mm"]["max"].get<double>(), 0.5, 1e-9);
  EXPECT_NEAR(json["expected_tre_mm"]["rms"].get<double>(), std::sqrt((0.09 + 0.25) / 2), 1e-9);
  ASSERT_EQ(json["candidates"].size(), 2U);
  EXPECT_EQ(json["candidates"][1]["similarity"], 0.25);
  EXPECT_NEAR(json["candidates"][1]["tre_mm"]["max"].get<double>(), 100 * std::sin(0.1), 1e-9);
  EXPECT_NEAR(json["candidates"][1]["tre_mm"]["mean"].get<double>(), 80 * std::sin(0.1), 1e-9);

  const std::string text = evaluate({"--candidates"}).output;
  EXPECT_NE(text.find("expected by the result, mm: RMS 0.412, max 0.500"), std::string::npos)
      << text;
  EXPECT_NE(text.find("candidate 1, similarity 0.2500, overlap 0.75, TRE, mm: mean 7.987"),
            std::string::npos)
      << text;
}

TEST_F(Evaluate, AResultThatIsNotRegisteredEndsWithStatusThree) {
  result_.status = RegistrationStatus::kLowConfidence;
  result_.message = "two optima are alike";
  result_.T_us_ct.reset();
  const Outcome outcome = evaluate();
  EXPECT_EQ(outcome.exit_status, 3);
  EXPECT_EQ(outcome.output, "targets: 2\n");
  EXPECT_NE(outcome.errors.find("low_confidence (two optima are alike)"), std::string::npos)
      << outcome.errors;

  const Outcome as_json = evaluate({"--json", "--candidates"});
  EXPECT_EQ(as_json.exit_status, 3);
  const auto json = nlohmann::json::parse(as_json.output);
  EXPECT_EQ(json["status"], "low_confidence");
  EXPECT_EQ(json["message"], "two optima are alike");
  EXPECT_TRUE(json["tre_mm"].is_null());
  EXPECT_NEAR(json["candidates"][0]["tre_mm"]["mean"].get<double>(), 4.0, 1e-9);
}

TEST_F(Evaluate, BadInputEndsWithStatusTwo) {
  const auto refused = [&](const std::string& named) {
    const Outcome outcome = evaluate();
    EXPECT_EQ(outcome.exit_status, 2) << outcome.errors;
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
    EXPECT_EQ(outcome.output, "");
  };
  std::filesystem::remove(path("truth.tfm"));
  refused("truth.tfm");
  write_T_us_ct(T_true_, path("truth.tfm"));
  std::ofstream(path("targets.csv")) << "x,y,z\n1,2\n";
  refused("targets.csv");
}

}  // namespace
}  // namespace usct::test
