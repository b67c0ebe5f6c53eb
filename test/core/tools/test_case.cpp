#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/tools/run_usct.h"
#include "us_ct_registration/evaluation/study_case.h"
#include "us_ct_registration/io/results/points_io.h"

namespace usct::test {
namespace {

/// A tiny phantom, and landmarks: the points of its kidney that lie well within the ultrasound.
class Case : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const Outcome outcome =
        run_usct({"phantom", "--quiet", "--scene", "agar", "--output", path("phantom"), "--size",
                  "60", "32", "24", "--ct-size", "70", "56", "36", "--ct-spacing", "3", "3", "4"});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
    const StudyCase phantom = read_study_case(path("phantom"));
    std::vector<Eigen::Vector3d> us;
    std::vector<Eigen::Vector3d> ct;
    for (std::size_t i = 0; i < phantom.targets_us_mm.size(); ++i)
      if (std::hypot(phantom.targets_us_mm[i].x(), phantom.targets_us_mm[i].z()) < 15.0) {
        us.push_back(phantom.targets_us_mm[i]);
        ct.push_back(phantom.targets_ct_mm[i]);
      }
    ASSERT_GE(us.size(), 4U);
    write_points_mm(us, path("us.csv"));
    write_points_mm(ct, path("ct.csv"));
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string path(const std::string& name) { return (folder_->path() / name).string(); }

  /// Makes the case `name` of the phantom's images.
  static Outcome make(const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{
        "case",     "--ct",    path("phantom/ct.nrrd"), "--us", path("phantom/us.nrrd"),
        "--output", path(name)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  }
  static void expect_refused(const std::vector<std::string>& more,
                             const std::vector<std::string>& parts) {
    const Outcome outcome = make("refused", more);
    EXPECT_EQ(outcome.exit_status, 2) << outcome.errors;
    for (const std::string& part : parts)
      EXPECT_NE(outcome.errors.find(part), std::string::npos) << outcome.errors;
    EXPECT_FALSE(std::filesystem::exists(path("refused")));
  }

 private:
  static TemporaryFolder* folder_;
};
TemporaryFolder* Case::folder_ = nullptr;

/// Of N landmarks, at which TRE^2 is FLE^2 2 / N on average (Fitzpatrick et al. 1998).
TEST_F(Case, TheErrorOfTheTruthIsThatAtTheTargets) {
  std::vector<Eigen::Vector3d> moved = read_points_mm(path("us.csv"));
  for (std::size_t i = 0; i < moved.size(); ++i)
    moved[i][static_cast<int>(i % 3)] += i % 2 ? 2 : -2;
  write_points_mm(moved, path("moved.csv"));
  const Outcome outcome = make("own_moved", {"--landmarks", path("ct.csv"), path("moved.csv")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  double fre_mm = 0.0, fle_mm = 0.0, expected_mm = 0.0;
  int landmarks = 0, targets = 0;
  ASSERT_EQ(std::sscanf(outcome.output.c_str(),
                        "truth from %d landmarks: FRE %lf mm, FLE %lf mm, expected error at the %d "
                        "targets %lf mm",
                        &landmarks, &fre_mm, &fle_mm, &targets, &expected_mm),
            5)
      << outcome.output;
  EXPECT_EQ(landmarks, targets);
  EXPECT_GT(fle_mm, 1.0);
  EXPECT_NEAR(expected_mm, fle_mm * std::sqrt(2.0 / landmarks), 0.01);
}

TEST_F(Case, LandmarksGiveTruthAndTargetsOfAStudy) {
  const Outcome outcome = make("own_1", {"--landmarks", path("ct.csv"), path("us.csv")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_NE(outcome.output.find(" landmarks: FRE 0.00 mm"), std::string::npos) << outcome.output;
  const StudyCase made = read_study_case(path("own_1"));
  const StudyCase phantom = read_study_case(path("phantom"));
  EXPECT_TRUE(made.T_us_ct_true.isApprox(phantom.T_us_ct_true, 1e-4));
  EXPECT_EQ(made.ct.voxels, phantom.ct.voxels);
  EXPECT_EQ(made.ultrasound.voxels, phantom.ultrasound.voxels);
  EXPECT_EQ(made.targets_us_mm, read_points_mm(path("us.csv")));
  EXPECT_EQ(made.targets_ct_mm, read_points_mm(path("ct.csv")));

  const Outcome study = run_usct({"study", path("own_1"), "--preset", "fast", "--starts", "1",
                                  "--quiet", "--profiles", "--output", path("own.json")});
  ASSERT_EQ(study.exit_status, 0) << study.errors;
  const auto json = nlohmann::json::parse(read_text(path("own.json")));
  EXPECT_EQ(json["cases"][0]["name"], "own_1");
  ASSERT_EQ(json["profiles"].size(), 1U);
  EXPECT_EQ(json["profiles"][0]["axes"].size(), 6U);
}

TEST_F(Case, ATransformNeedsTargetsWhosePlaceInTheCtMayBeUnknown) {
  const std::vector<std::string> truth{"--truth", path("phantom/truth.tfm")};
  expect_refused(truth, {"--targets", "must be given with --truth"});
  const Outcome outcome =
      make("own_2", {truth[0], truth[1], "--targets", path("phantom/targets.csv")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(read_study_case(path("own_2")).targets_us_mm,
            read_points_mm(path("phantom/targets.csv")));
  EXPECT_FALSE(std::filesystem::exists(path("own_2/targets_ct.csv")));
  expect_refused({truth[0], truth[1], "--targets", path("phantom/targets.csv"), "--targets-ct",
                  path("ct.csv")},
                 {"ct.csv", "points, must have as many as"});
}

/// Points at a few mm from the middle of the landmarks, so that any order fits to a few mm; and
/// where they lie in the ultrasound.
class CaseOfCloseLandmarks : public Case {
 protected:
  CaseOfCloseLandmarks() {
    const Eigen::Isometry3d T_us_ct = read_study_case(path("phantom")).T_us_ct_true;
    const Eigen::Vector3d middle_mm = read_study_case(path("phantom")).centre_ct_mm();
    for (const Eigen::Vector3d& offset : {Eigen::Vector3d(8, 0, 0),
                                          {-3, 1, 0},
                                          {0, 9, 1},
                                          {1, -2, 5},
                                          {0, 0, -4},
                                          Eigen::Vector3d(5, 5, 5),
                                          {-6, 2, 3},
                                          {2, -5, -3},
                                          {-1, 4, -6}}) {
      ct_.push_back(middle_mm + offset);
      us_.push_back(T_us_ct * ct_.back());
    }
  }
  /// The errors of making a case of the points in ct_ and us_.
  std::string warned_of() const {
    static int count = 0;
    const std::string number = std::to_string(++count);
    write_points_mm(ct_, path(number + "_ct.csv"));
    write_points_mm(us_, path(number + "_us.csv"));
    const Outcome outcome = make(
        "close_" + number, {"--landmarks", path(number + "_ct.csv"), path(number + "_us.csv")});
    EXPECT_EQ(outcome.exit_status, 0) << outcome.errors;
    return outcome.errors;
  }
  std::vector<Eigen::Vector3d> ct_, us_;
};

TEST_F(CaseOfCloseLandmarks, TheRightOrderIsNotWarnedOf) { EXPECT_EQ(warned_of(), ""); }

TEST_F(CaseOfCloseLandmarks, AnotherOrderOfFewIsNamed) {
  ct_.resize(4);
  us_.resize(4);
  std::reverse(ct_.begin(), ct_.end());
  const std::string warning = warned_of();
  EXPECT_NE(warning.find("do not fit each other (FRE "), std::string::npos) << warning;
  EXPECT_NE(warning.find("with the points of the CT in the order 4, 3, 2, 1 it would be 0.00 mm"),
            std::string::npos)
      << warning;
}

TEST_F(CaseOfCloseLandmarks, AnExchangeInManyIsNamed) {
  std::swap(ct_[2], ct_[7]);
  const std::string warning = warned_of();
  EXPECT_NE(warning.find("with points 3 and 8 of one file exchanged it would be 0.00 mm"),
            std::string::npos)
      << warning;
}

/// A point that was marked at the wrong place fits in no order.
TEST_F(CaseOfCloseLandmarks, AWrongPointIsWarnedOf) {
  ct_.resize(4);
  us_.resize(4);
  ct_[0].x() += 40.0;
  const std::string warning = warned_of();
  EXPECT_NE(warning.find("do not fit each other (FRE "), std::string::npos) << warning;
  EXPECT_NE(warning.find("): check that both files have the same points"), std::string::npos)
      << warning;
}

TEST_F(Case, ACartesianVolumeIsToldOfWhatItCanUse) {
  ASSERT_EQ(run_usct({"convert", path("phantom/us.nrrd"), path("space.nrrd"), "--scan-convert", "3",
                      "--quiet"})
                .exit_status,
            0);
  const Outcome outcome =
      run_usct({"case", "--ct", path("phantom/ct.nrrd"), "--us", path("space.nrrd"), "--landmarks",
                path("ct.csv"), path("us.csv"), "--output", path("refused")});
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_NE(outcome.errors.find("is a Cartesian volume"), std::string::npos) << outcome.errors;
  EXPECT_EQ(outcome.errors.find("--probe"), std::string::npos) << outcome.errors;
}

TEST_F(Case, PointsOfOtherAxesAreRefused) {
  // Far outside, as points with other signs of the axes are.
  std::vector<Eigen::Vector3d> points = read_points_mm(path("ct.csv"));
  for (Eigen::Vector3d& p : points) p += Eigen::Vector3d(-400.0, 0.0, 0.0);
  write_points_mm(points, path("shifted.csv"));
  expect_refused({"--landmarks", path("shifted.csv"), path("us.csv")},
                 {"shifted.csv", "point 1 is (", "must lie in the CT (LPS"});
  expect_refused({"--landmarks", path("ct.csv"), path("shifted.csv")},
                 {"shifted.csv", "point 1 is (", "must lie in the ultrasound"});
  expect_refused({}, {"--landmarks", "or --truth must be given"});
  std::vector<Eigen::Vector3d> fewer = read_points_mm(path("ct.csv"));
  fewer.pop_back();
  write_points_mm(fewer, path("fewer.csv"));
  expect_refused({"--landmarks", path("fewer.csv"), path("us.csv")},
                 {path("us.csv") + ": has ", "must have as many as " + path("fewer.csv")});
}

}  // namespace
}  // namespace usct::test
