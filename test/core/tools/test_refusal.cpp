#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/tools/run_usct.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/registration/right_probability.h"

namespace usct::test {
namespace {

/// A small agar phantom, and its ultrasound with the lines in reverse order, as of a probe that was
/// held the wrong way round: no pose registers it.
class Refusal : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const Outcome outcome = run_usct({"phantom",      "--scene",    "agar",   "--seed", "3",
                                      "--output",     path("agar"), "--size", "110",    "80",
                                      "50",           "--ct-size",  "110",    "110",    "80",
                                      "--ct-spacing", "0.9",        "0.9",    "1.2",    "--quiet"});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
    PreScanVolume us = read_prescan_nrrd(path("agar/us.nrrd"));
    const PreScanVolume recorded = us;
    const auto length = us.geometry.samples();
    const auto lines = us.geometry.lines();
    for (int line = 0; line < us.geometry.frames() * lines; ++line) {
      const int opposite = line / lines * lines + lines - 1 - line % lines;
      std::copy_n(recorded.voxels.begin() + opposite * length, length,
                  us.voxels.begin() + line * length);
    }
    write_prescan_nrrd(us, path("mirrored.nrrd"));
    std::ofstream(path("options.yaml"))
        << "preset: phantom\nsearch: {starts: {count: 128, rotation_deg: 10, translation_mm: 10}, "
           "rounds: 1}\n";
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string path(const std::string& name) { return (folder_->path() / name).string(); }

  static Outcome registered(const std::string& us, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"register",
                                       "--ct",
                                       path("agar/ct.nrrd"),
                                       "--us",
                                       path(us),
                                       "--initial",
                                       path("agar/truth.tfm"),
                                       "--options",
                                       path("options.yaml"),
                                       "--output",
                                       path("result.json"),
                                       "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  }
  static std::string formatted(const char* format, double value) {
    char text[128];
    std::snprintf(text, sizeof(text), format, value);
    return text;
  }
  static void expect_lines(const std::string& output, const std::vector<std::string>& lines) {
    for (const std::string& line : lines)
      EXPECT_NE(output.find(line), std::string::npos) << line << "\n" << output;
  }

 private:
  static TemporaryFolder* folder_;
};
TemporaryFolder* Refusal::folder_ = nullptr;

TEST_F(Refusal, SaysWhatEachKindOfEvidenceSaysAndWhatWouldHelp) {
  const Outcome outcome = registered("mirrored.nrrd", {"--pictures", path("pictures")});
  ASSERT_EQ(outcome.exit_status, 3) << outcome.output;
  const Measures measures = read_result(path("result.json")).measures;
  ASSERT_TRUE(measures.wrong_probability && measures.mirror_ratio && measures.chance_ratio &&
              measures.parts_mm);
  expect_lines(
      outcome.output,
      {formatted("more than 5 mm off: %.3f\n", *measures.wrong_probability),
       "comparison with mirrored ultrasound (",
       formatted("the pose has %.2f times the similarity that its best mirror image reaches",
                 *measures.mirror_ratio),
       "what would help: ", "comparison with chance (",
       formatted("the pose has %.2f times the similarity that chance reaches",
                 *measures.chance_ratio),
       "same anatomy (", formatted("move the pose by %.1f mm", halves_motion_mm(measures))});
  EXPECT_EQ(outcome.output.find("expected error"), std::string::npos) << outcome.output;
  for (const char* picture : {"before_after.png", "fusion.png", "slices.png"})
    EXPECT_TRUE(std::filesystem::exists(path("pictures/") + picture)) << picture;
}

TEST_F(Refusal, ARegisteredPoseHasProbabilityExpectedErrorAndBound) {
  const Outcome outcome = registered("agar/us.nrrd");
  ASSERT_EQ(outcome.exit_status, 0) << outcome.output;
  const Measures measures = read_result(path("result.json")).measures;
  ASSERT_TRUE(measures.wrong_probability && measures.expected_error_mm && measures.error_bound_mm);
  expect_lines(
      outcome.output,
      {formatted("more than 5 mm off: %.3f\n", *measures.wrong_probability),
       formatted("expected error in the middle of the field: %.2f mm", *measures.expected_error_mm),
       formatted("below %.2f mm in 90 of 100", *measures.error_bound_mm)});
  EXPECT_EQ(outcome.output.find("what would help"), std::string::npos) << outcome.output;
}

TEST_F(Refusal, SlicesOfARefusedResultAreMarked) {
  const auto slices = [](const std::string& us, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"slices",
                                       "--us",
                                       path(us),
                                       "--ct",
                                       path("agar/ct.nrrd"),
                                       "--result",
                                       path("result.json"),
                                       "--pixel",
                                       "1",
                                       "--output",
                                       path("slices.png"),
                                       "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  };
  /// The colour of the sheet's corner, blue first: red only in the header of a refused result.
  const auto is_red = [] {
    const cv::Vec3b corner = cv::imread(path("slices.png")).at<cv::Vec3b>(1, 1);
    return corner[2] > 150 && corner[0] < 50 && corner[1] < 50;
  };
  ASSERT_EQ(registered("mirrored.nrrd").exit_status, 3);
  ASSERT_EQ(slices("mirrored.nrrd").exit_status, 0);
  EXPECT_TRUE(is_red());
  const Outcome both = slices("mirrored.nrrd", {"--transform", path("agar/truth.tfm")});
  EXPECT_EQ(both.exit_status, 2);
  EXPECT_NE(both.errors.find("excludes"), std::string::npos) << both.errors;

  ASSERT_EQ(registered("agar/us.nrrd").exit_status, 0);
  ASSERT_EQ(slices("agar/us.nrrd").exit_status, 0);
  EXPECT_FALSE(is_red());

  write_result(RegistrationResult(), path("result.json"));
  const Outcome nothing = slices("agar/us.nrrd");
  EXPECT_EQ(nothing.exit_status, 2);
  EXPECT_NE(nothing.errors.find("--result"), std::string::npos) << nothing.errors;
}

TEST_F(Refusal, AStudyCanAskForPosesWithoutAJudgement) {
  const auto study = [](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{
        "study",    path("agar"), "--options", path("options.yaml"), "--kinds",         "mirrored",
        "--starts", "1",          "--quiet",   "--output",           path("study.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 0) << outcome.errors;
    return nlohmann::json::parse(read_text(path("study.json")));
  };
  const nlohmann::json judged = study({});
  const auto gate_of = [](const nlohmann::json& json) {
    return json["study"]["methods"][0]["options"]["confidence.gates.max_wrong_probability"];
  };
  EXPECT_NE(gate_of(judged), "none");
  EXPECT_EQ(judged["runs"][0]["status"], "low_confidence");
  EXPECT_TRUE(judged["runs"][0]["measures"].contains("wrong_probability"));
  const nlohmann::json unjudged = study({"--unjudged"});
  EXPECT_EQ(gate_of(unjudged), "none");
  EXPECT_EQ(unjudged["runs"][0]["status"], "registered");
  EXPECT_FALSE(unjudged["runs"][0]["measures"].contains("wrong_probability"));
}

}  // namespace
}  // namespace usct::test
