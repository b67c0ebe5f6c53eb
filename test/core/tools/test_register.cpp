#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/tools/run_usct.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// A small agar phantom, registered from some millimetres and degrees beside the truth.
class Register : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    phantom_ = std::make_unique<TemporaryFolder>();
    const Outcome outcome = run_usct({"phantom", "--scene", "agar",     "--seed",       "3",
                                      "--size",  "110",     "80",       "50",           "--ct-size",
                                      "110",     "110",     "80",       "--ct-spacing", "0.9",
                                      "0.9",     "1.2",     "--output", case_file(""),  "--quiet"});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  }
  static void TearDownTestSuite() { phantom_.reset(); }

  void SetUp() override {
    T_true_ = read_T_us_ct(case_file("truth.tfm"));
    const Isometry3d motion = Eigen::Translation3d(3.0, -4.0, 2.0) *
                              Eigen::AngleAxisd(0.06, Vector3d(1, 2, -1).normalized());
    T_initial_ = about_middle(motion) * T_true_;
    write_T_us_ct(T_initial_, path("initial.tfm"));
  }

  static std::string case_file(const std::string& name) {
    return (phantom_->path() / "case" / name).string();
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  static Isometry3d about_middle(const Isometry3d& motion) {
    const Eigen::Translation3d middle(0.0, 90.0, 0.0);
    return middle * motion * middle.inverse();
  }

  /// Registers from the initial pose, with few starts.
  Outcome registered(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{"--initial", path("initial.tfm"), "--options", options()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  /// Runs `usct register` without initial pose and options.
  Outcome run(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{
        "register",           "--ct",     case_file("ct.nrrd"), "--us",
        case_file("us.nrrd"), "--output", path("result.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  }
  std::string options() const {
    std::ofstream(path("options.yaml"))
        << "preset: phantom\nsearch: {starts: {count: 64, rotation_deg: 10, "
           "translation_mm: 10}}\n";
    return path("options.yaml");
  }
  double mean_error_mm(const Isometry3d& T_us_ct) const {
    return evaluate_targets(T_us_ct, T_true_, read_points_mm(case_file("targets.csv"))).mean_mm;
  }
  void expect_refused(const std::vector<std::string>& arguments, const std::string& named) const {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_status, 2) << outcome.errors;
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << named << "\n" << outcome.errors;
    EXPECT_FALSE(std::filesystem::exists(path("result.json")));
  }

  static std::unique_ptr<TemporaryFolder> phantom_;
  TemporaryFolder folder_;
  Isometry3d T_true_;
  Isometry3d T_initial_;
};
std::unique_ptr<TemporaryFolder> Register::phantom_;

TEST_F(Register, FindsThePoseAndWritesResultTransformAndPictures) {
  ASSERT_GT(mean_error_mm(T_initial_), 4.0);
  const Outcome outcome = registered({"--transform", path("found.tfm"), "--pictures",
                                      path("pictures"), "--targets", case_file("targets.csv")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  const RegistrationResult result = read_result(path("result.json"));
  EXPECT_EQ(result.status, RegistrationStatus::kRegistered);
  ASSERT_TRUE(result.T_us_ct);
  EXPECT_LT(mean_error_mm(*result.T_us_ct), 2.0);
  EXPECT_TRUE(read_T_us_ct(path("found.tfm")).isApprox(*result.T_us_ct, 1e-9));
  EXPECT_EQ(result.options.at("search.starts.count"), "64");
  EXPECT_FALSE(result.version.empty());
  for (const char* picture : {"before_after.png", "fusion.png", "slices.png"})
    EXPECT_TRUE(std::filesystem::exists(path("pictures/" + std::string(picture)))) << picture;
  for (const char* line : {"status: registered", "similarity: ", "overlap", "expected error",
                           "evaluations: ", "seconds: ", "result.json", "found.tfm"})
    EXPECT_NE(outcome.output.find(line), std::string::npos) << line << "\n" << outcome.output;
}

TEST_F(Register, QuestionsTargetsOfAnotherFrameOrUnit) {
  const std::vector<Eigen::Vector3d> targets_us_mm = read_points_mm(case_file("targets.csv"));
  std::vector<Eigen::Vector3d> in_m;
  std::vector<Eigen::Vector3d> in_ct_mm;
  for (const Eigen::Vector3d& target : targets_us_mm) {
    in_m.push_back(1e-3 * target);
    in_ct_mm.push_back(T_true_.inverse() * target - Eigen::Vector3d(0.0, 0.0, 1000.0));
  }
  write_points_mm(in_m, path("metres.csv"));
  write_points_mm(in_ct_mm, path("ct.csv"));
  const auto questions = [&](const std::string& targets) {
    return registered({"--targets", targets}).errors;
  };
  EXPECT_EQ(questions(case_file("targets.csv")), "");
  EXPECT_NE(questions(path("metres.csv")).find("metres.csv: all points lie within 0.1"),
            std::string::npos);
  EXPECT_NE(
      questions(path("ct.csv")).find("400 of 400 points lie far outside the ultrasound, by up to "),
      std::string::npos);
}

TEST_F(Register, PrintsTheAcquisitionErrorsThatItEstimated) {
  std::ofstream(path("errors.yaml"))
      << "preset: phantom\nsearch: {starts: {count: 64, rotation_deg: 10, translation_mm: 10}}\n";
  const Outcome outcome =
      run({"--initial", path("initial.tfm"), "--options", path("errors.yaml"), "--quiet"});
  EXPECT_NE(outcome.exit_status, 2) << outcome.errors;
  const Measures measures = read_result(path("result.json")).measures;
  ASSERT_TRUE(measures.depth_error && measures.sweep_error);
  for (const auto& [name, error] :
       {std::pair{"depth", *measures.depth_error}, std::pair{"sweep", *measures.sweep_error}}) {
    char line[64];
    std::snprintf(line, sizeof(line), "estimated %s error: %+.2f %%\n", name, 100.0 * error);
    EXPECT_NE(outcome.output.find(line), std::string::npos) << line << outcome.output;
  }
}

/// A robot takes the transform for a sign that all went well.
TEST_F(Register, NoTransformIsWrittenIfThePicturesFail) {
  std::filesystem::create_directories(path("pictures/fusion.png"));
  const Outcome outcome =
      registered({"--transform", path("found.tfm"), "--pictures", path("pictures")});
  EXPECT_EQ(outcome.exit_status, 2) << outcome.errors;
  EXPECT_FALSE(std::filesystem::exists(path("found.tfm")));
}

TEST_F(Register, TrueBeamsAreRefusedByThePresetOfVariantA) {
  expect_refused({"--initial", path("initial.tfm"), "--preset", "thesis_a"}, "--parallel-beams");
}

TEST_F(Register, JsonOnStandardOutputIsTheResult) {
  const Outcome outcome = registered({"--json", "--quiet"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(outcome.output, read_text(path("result.json")));
  EXPECT_EQ(outcome.errors, "");
}

TEST_F(Register, TheResultDoesNotDependOnThreadsOrTheRun) {
  const auto result = [&](const std::vector<std::string>& more) {
    const Outcome outcome = registered(more);
    EXPECT_EQ(outcome.exit_status, 0) << outcome.errors;
    auto json = nlohmann::json::parse(read_text(path("result.json")));
    json.erase("seconds");
    return json;
  };
  const auto first = result({"--threads", "1"});
  EXPECT_EQ(first, result({"--threads", "1"}));
  EXPECT_EQ(first, result({"--threads", "3"}));
  EXPECT_EQ(first, result({}));
  EXPECT_NE(first, result({"--seed", "9"})) << "the options hold the seed";
}

TEST_F(Register, LandmarksGiveTheInitialPose) {
  const std::vector<Vector3d> points_ct = {{0, 0, 0}, {40, 0, 0}, {0, 30, 5}, {5, 0, 50}};
  std::vector<Vector3d> points_us;
  for (const Vector3d& p : points_ct) points_us.push_back(T_initial_ * p);
  write_points_mm(points_ct, path("ct.csv"));
  write_points_mm(points_us, path("us.csv"));
  ASSERT_EQ(registered().exit_status, 0);
  const RegistrationResult expected = read_result(path("result.json"));
  const Outcome outcome =
      run({"--landmarks", path("ct.csv"), path("us.csv"), "--options", options()});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_NE(outcome.errors.find("4 pairs"), std::string::npos) << outcome.errors;
  EXPECT_LT(mean_error_mm(*read_result(path("result.json")).T_us_ct * expected.T_us_ct->inverse() *
                          T_true_),
            0.5);
  EXPECT_EQ(outcome.errors.find("do not fit"), std::string::npos) << outcome.errors;

  std::swap(points_us[1], points_us[3]);
  write_points_mm(points_us, path("us.csv"));
  const Outcome exchanged =
      run({"--landmarks", path("ct.csv"), path("us.csv"), "--options", options()});
  EXPECT_NE(exchanged.errors.find("with the points of the CT in the order 1, 4, 3, 2"),
            std::string::npos)
      << exchanged.errors;

  std::vector<Vector3d> points_ct_m;
  for (const Vector3d& p : points_ct) points_ct_m.push_back(0.001 * p);
  write_points_mm(points_ct_m, path("ct_m.csv"));
  const Outcome metres =
      run({"--landmarks", path("ct_m.csv"), path("us.csv"), "--options", options()});
  EXPECT_NE(metres.errors.find("ct_m.csv: all points lie within 0.0707 mm: are they in metres?"),
            std::string::npos)
      << metres.errors;
  EXPECT_EQ(metres.errors.find(path("us.csv") + ": all points"), std::string::npos);

  points_us.pop_back();
  write_points_mm(points_us, path("us.csv"));
  std::filesystem::remove(path("result.json"));
  expect_refused({"--landmarks", path("ct.csv"), path("us.csv")}, "us.csv: has 3 points");
}

TEST_F(Register, ExchangedFilesOfLandmarksAreRefused) {
  std::vector<Vector3d> points_ct;
  std::vector<Vector3d> points_us;
  for (const Vector3d& p_us : read_points_mm(case_file("targets.csv"))) {
    if (std::hypot(p_us.x(), p_us.z()) > 15.0) continue;
    points_us.push_back(p_us);
    points_ct.push_back(T_true_.inverse() * p_us);
  }
  write_points_mm(points_ct, path("ct.csv"));
  write_points_mm(points_us, path("us.csv"));
  expect_refused({"--landmarks", path("us.csv"), path("ct.csv")}, "us.csv: point 1 is (");
  expect_refused({"--landmarks", path("us.csv"), path("ct.csv")},
                 "of the two files of --landmarks, the first must be of the CT");

  points_ct.emplace_back(0.0, 0.0, 500.0);  // beside the CT, which may be a part of a larger one
  points_us.push_back(T_true_ * points_ct.back());
  write_points_mm(points_ct, path("ct.csv"));
  write_points_mm(points_us, path("us.csv"));
  expect_refused({"--landmarks", path("us.csv"), path("ct.csv")}, "the first must be of the CT");
  const Outcome beside =
      run({"--landmarks", path("ct.csv"), path("us.csv"), "--options", options()});
  EXPECT_EQ(beside.exit_status, 0) << beside.errors;
  EXPECT_NE(beside.errors.find("usct: warning: " + path("ct.csv") + ": point "), std::string::npos)
      << beside.errors;
}

/// An inverted transform, say.
TEST_F(Register, ACtThatIsFarAwayIsRefusedWithWhatToCheck) {
  write_T_us_ct(Eigen::Isometry3d(Eigen::Translation3d(0, 2000, 0)), path("far.tfm"));
  const Outcome outcome = run({"--initial", path("far.tfm"), "--options", options()});
  EXPECT_EQ(outcome.exit_status, 3);
  EXPECT_NE(outcome.errors.find("nowhere near the ultrasound at the initial pose: check that pose, "
                                "its direction (it may be inverted), and that no files"),
            std::string::npos)
      << outcome.errors;
}

/// With nothing left to search, the found pose is the initial pose itself.
TEST_F(Register, WithoutAnInitialPoseTheMiddlesMeetInTheGivenDirection) {
  RegistrationOptions only_start = preset("fast");
  LevelOptions level = only_start.search.levels.back();
  level.optimizer.max_evaluations = 1;
  only_start.search.levels = {level};
  only_start.search.starts.reset();
  only_start.search.rounds = 1;
  only_start.refinement.reset();
  // Else it would go on to search as `patient`, or to where blocks of the field would rather lie.
  only_start.confidence.gates.max_wrong_probability.reset();
  std::ofstream(path("start.yaml")) << registration_options_yaml(only_start);
  const auto pose = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"--options", path("start.yaml")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_NE(outcome.exit_status, 2) << outcome.errors;
    return read_result(path("result.json")).candidates.at(0).T_us_ct;
  };
  const Isometry3d T = pose({"--probe-direction", "right", "superior"});
  EXPECT_TRUE((T.linear() * Vector3d(-1, 0, 0)).isApprox(Vector3d::UnitY(), 1e-12));
  EXPECT_TRUE((T.linear() * Vector3d(0, 0, 1)).isApprox(Vector3d::UnitX(), 1e-12));
  const Grid grid = read_volume<std::int16_t>(case_file("ct.nrrd")).grid;
  const BeamGrid beams = beam_grid(read_prescan_nrrd(case_file("us.nrrd")).geometry);
  Vector3d middle = Vector3d::Zero();
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l)
      for (int s = 0; s < beams.samples(); ++s) middle += beams.point(f, l, s);
  middle /= static_cast<double>(beams.frames) * beams.lines * beams.samples();
  EXPECT_LT((T * grid.centre_mm() - middle).norm(), 1e-6);
}

TEST_F(Register, WithoutAnInitialPoseItSaysWhatToGive) {
  expect_refused({}, "--initial");
  expect_refused({"--preset", "fast"}, "--landmarks");
  expect_refused({"--probe-direction", "left", "right"}, "right angles");
  expect_refused({"--probe-direction", "left"}, "--probe-direction");
  expect_refused({"--initial", path("initial.tfm"), "--probe-direction", "left", "superior"},
                 "excludes");
}

TEST_F(Register, AllOrientationsNeedStarts) {
  std::ofstream(path("no_starts.yaml")) << "preset: fast\nsearch: {starts: none}\n";
  expect_refused({"--options", path("no_starts.yaml"), "--all-orientations"}, "--all-orientations");
  std::ofstream(path("few.yaml")) << "preset: fast\nsearch: {starts: {count: 32}}\n";
  EXPECT_NE(run({"--options", path("few.yaml"), "--all-orientations"}).exit_status, 2);
  const RegistrationResult result = read_result(path("result.json"));
  EXPECT_EQ(result.options.at("search.starts.region"), "ball");
  EXPECT_EQ(result.options.at("search.starts.rotation_deg"), "180");
  EXPECT_EQ(result.options.at("search.starts.count"), "64");  // twice as many, for they lie wider
}

TEST_F(Register, ARefusalEndsWithStatusThreeAndLeavesAnExistingTransform) {
  Isometry3d far = T_true_;
  far.translation().z() += 500.0;
  write_T_us_ct(far, path("far.tfm"));
  for (const bool exists : {false, true}) {
    if (exists) write_T_us_ct(T_true_, path("found.tfm"));
    const std::string before = exists ? read_text(path("found.tfm")) : "";
    const Outcome outcome =
        run({"--initial", path("far.tfm"), "--transform", path("found.tfm"), "--quiet"});
    EXPECT_EQ(outcome.exit_status, 3) << outcome.errors;
    EXPECT_NE(outcome.output.find("status: no_overlap"), std::string::npos) << outcome.output;
    EXPECT_NE(outcome.errors.find("found.tfm: not written"), std::string::npos) << outcome.errors;
    EXPECT_EQ(outcome.errors.find("stays as it was") != std::string::npos, exists);
    const RegistrationResult result = read_result(path("result.json"));
    EXPECT_EQ(result.status, RegistrationStatus::kNoOverlap);
    EXPECT_FALSE(result.T_us_ct);
    EXPECT_EQ(std::filesystem::exists(path("found.tfm")), exists);
    EXPECT_EQ(exists ? read_text(path("found.tfm")) : "", before);
  }
}

TEST_F(Register, VariantARegistersScanConvertedUltrasound) {
  // So small a phantom need not pass the gates; this test is about the pose that is found.
  registered({"--parallel-beams", "1.2"});
  const RegistrationResult result = read_result(path("result.json"));
  ASSERT_FALSE(result.candidates.empty()) << result.message;
  EXPECT_LT(mean_error_mm(result.candidates.front().T_us_ct), 3.0);
}

TEST_F(Register, BadInputIsNamedAndNothingIsWritten) {
  const std::string initial = path("initial.tfm");
  expect_refused({"--initial", path("absent.tfm")}, "absent.tfm");
  expect_refused({"--initial", initial, "--preset", "fats"}, "'fats', must be one of fast, global");
  expect_refused({"--initial", initial, "--options", path("absent.yaml")}, "absent.yaml");
  std::ofstream(path("bad.yaml"))
      << "preset: fast\nsearch: {levels: {1: {optimizer: {step: 3}}}}\n";
  expect_refused({"--initial", initial, "--options", path("bad.yaml")},
                 "bad.yaml: key 'search.levels[1].optimizer.step' is unknown");
  expect_refused({"--initial", initial, "--options", path("bad.yaml"), "--preset", "fast"},
                 "excludes");
  expect_refused({"--initial", initial, "--transform", path("found.png")}, "--transform");
  expect_refused({"--initial", initial, "--transform", path("absent/found.tfm")}, "--transform");
  expect_refused({"--initial", initial, "--pictures", path("absent/pictures")}, "--pictures");
  expect_refused({"--initial", initial, "--targets", path("absent.csv")}, "absent.csv");
  expect_refused({"--initial", initial, "--us-mask", case_file("ct.nrrd")}, "--us-mask");
  expect_refused({"--initial", initial, "--beam-axis", "+x"},
                 "--beam-axis: is given, must be left out unless");
  expect_refused({"--initial", initial, "--threads", "0"}, "--threads");
  expect_refused({"--initial", initial, "--series", "1.2"}, "DICOM");
  expect_refused({"--initial", initial, "--seed", "-1"}, "--seed");
  std::ofstream(path("scaled.tfm"))
      << "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
         "Parameters: 1.1 0 0 0 1.1 0 0 0 1.1 0 0 0\nFixedParameters: 0 0 0\n";
  expect_refused({"--initial", path("scaled.tfm")}, "scaled.tfm");
  const Outcome swapped =
      run_usct({"register", "--ct", case_file("us.nrrd"), "--us", case_file("ct.nrrd"), "--initial",
                initial, "--output", path("result.json")});
  EXPECT_EQ(swapped.exit_status, 2) << swapped.errors;
  const Outcome nowhere =
      run_usct({"register", "--ct", case_file("ct.nrrd"), "--us", case_file("us.nrrd"), "--initial",
                initial, "--output", path("absent/result.json")});
  EXPECT_EQ(nowhere.exit_status, 2) << nowhere.errors;
  EXPECT_NE(nowhere.errors.find("--output"), std::string::npos) << nowhere.errors;
  // A label map, say.
  std::ofstream(path("labels.nrrd")) << "precious";
  const Outcome image =
      run_usct({"register", "--ct", case_file("ct.nrrd"), "--us", case_file("us.nrrd"), "--initial",
                initial, "--output", path("labels.nrrd")});
  EXPECT_EQ(image.exit_status, 2) << image.errors;
  EXPECT_NE(image.errors.find("must end in .json"), std::string::npos) << image.errors;
  EXPECT_EQ(read_text(path("labels.nrrd")), "precious");
}

TEST_F(Register, LandmarksThatDoNotSufficeAreNamedByTheirFiles) {
  write_points_mm({{0, 0, 0}, {40, 0, 0}, {0, 30, 0}}, path("three.csv"));
  write_points_mm({{0, 0, 0}, {40, 0, 0}}, path("two.csv"));
  write_points_mm({{0, 0, 0}, {40, 0, 0}, {80, 0, 0}}, path("line.csv"));
  const auto refused = [&](const char* ct, const char* us, const std::string& named) {
    const Outcome outcome = run({"--landmarks", path(ct), path(us)});
    EXPECT_EQ(outcome.exit_status, 2);
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  };
  refused("three.csv", "two.csv",
          path("two.csv") + ": has 2 points, must have as many as " + path("three.csv") + ", 3");
  refused("two.csv", "two.csv", path("two.csv") + ": 2 points, must be at least 3");
  refused("three.csv", "line.csv", path("line.csv") + ": points lie on a line");
}

TEST_F(Register, ACartesianVolumeHasItsBeamsAlready) {
  const Outcome outcome =
      run_usct({"convert", case_file("us.nrrd"), path("space.nrrd"), "--scan-convert", "2"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  const Outcome refused =
      run_usct({"register", "--ct", case_file("ct.nrrd"), "--us", path("space.nrrd"), "--initial",
                path("initial.tfm"), "--parallel-beams", "2", "--output", path("result.json")});
  EXPECT_EQ(refused.exit_status, 2);
  EXPECT_NE(refused.errors.find("--parallel-beams: is given, must be left out unless"),
            std::string::npos)
      << refused.errors;
}

TEST(PresetsCommand, ListsAndPrints) {
  const Outcome list = run_usct({"presets"});
  EXPECT_EQ(list.exit_status, 0);
  for (const std::string& name : preset_names()) {
    EXPECT_NE(list.output.find(name + " "), std::string::npos) << name;
    EXPECT_EQ(run_usct({"presets", name}).output, preset_yaml(name));
    EXPECT_EQ(run_usct({"presets", name, "--complete"}).output,
              registration_options_yaml(preset(name)));
  }
  const Outcome unknown = run_usct({"presets", "best"});
  EXPECT_EQ(unknown.exit_status, 2);
  EXPECT_NE(unknown.errors.find("'best', must be one of fast, global"), std::string::npos);
}

}  // namespace
}  // namespace usct::test
