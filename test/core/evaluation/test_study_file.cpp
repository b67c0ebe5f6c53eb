#include <gtest/gtest.h>

#include <map>

#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/replaced.h"
#include "core/io/temporary_folder.h"
#include "test_paths.h"
#include "us_ct_registration/evaluation/study_file.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/options/registration_options_io.h"

namespace usct::test {
namespace {

const std::string kStudy = R"(cases: [cases/agar_*, cases/patient_1]
strangers: [cases/stranger_1]
methods:
  - preset: patient
  - name: search
    preset: patient
    options: {search: {starts: {count: 7}}}
    metrics: [ncc, local_lc2]
    optimizers: [nelder_mead, bobyqa]
  - name: scan_converted
    preset: thesis_a
    parallel_beams_mm: 1.5
    judged: false
starts:
  count: 20
  bins: 4
  seeds: [3, 5]
  kinds: [start, stranger]
  min_displacement_mm: 1
  max_displacement_mm: 20
  max_rotation_deg: 15
success_mm: 10
one_at_a_time: true
)";

class StudyFile : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"agar_2", "agar_1", "patient_1", "stranger_1"})
      std::filesystem::create_directories(folder_.path() / "cases" / name);
    write_text(folder_.path() / "cases" / "agar_notes", "no case");
  }
  std::filesystem::path path() const { return folder_.path() / "study.yaml"; }
  Study read(const std::string& yaml) const {
    write_text(path(), yaml);
    return read_study(path());
  }
  /// Fails unless a study with one text replaced by another is refused with a message that names
  /// the file and `named`.
  void expect_refused(const std::string& from, const std::string& to,
                      const std::string& named) const {
    expect_input_error([&] { read(replaced(kStudy, from, to)); }, {path().string(), named});
  }

  TemporaryFolder folder_;
};

TEST_F(StudyFile, IsReadWithAllItsKeys) {
  const Study study = read(kStudy);
  const auto folder = folder_.path() / "cases";
  EXPECT_EQ(study.cases, (std::vector<std::filesystem::path>{folder / "agar_1", folder / "agar_2",
                                                             folder / "patient_1"}));
  EXPECT_EQ(study.strangers, std::vector<std::filesystem::path>{folder / "stranger_1"});
  EXPECT_EQ(study.starts.starts, 20);
  EXPECT_EQ(study.starts.bins, 4);
  EXPECT_EQ(study.starts.seeds, (std::vector<std::uint32_t>{3, 5}));
  EXPECT_EQ(study.starts.kinds, (std::vector<TrialKind>{TrialKind::kStart, TrialKind::kStranger}));
  EXPECT_EQ(study.starts.min_displacement_mm, 1.0);
  EXPECT_EQ(study.starts.max_displacement_mm, 20.0);
  EXPECT_NEAR(study.starts.max_rotation_rad, radians(15.0), 1e-12);
  EXPECT_EQ(study.success_mm, 10.0);
  EXPECT_EQ(study.how, StudyThreads::kWithinTrial);
  EXPECT_EQ(read(replaced(kStudy, "one_at_a_time: true", "")).how, StudyThreads::kOverTrials);
}

TEST_F(StudyFile, MethodsAreAllCombinations) {
  const std::vector<StudyMethod> methods = read(kStudy).methods;
  std::vector<std::string> names;
  for (const StudyMethod& method : methods) names.push_back(method.name);
  EXPECT_EQ(names, (std::vector<std::string>{"patient", "search+ncc+nelder_mead",
                                             "search+ncc+bobyqa", "search+local_lc2+nelder_mead",
                                             "search+local_lc2+bobyqa", "scan_converted"}));
  const RegistrationOptions patient = preset("patient");
  EXPECT_EQ(registration_options_yaml(methods[0].options), registration_options_yaml(patient));
  const SearchOptions& search = methods[1].options.search;
  EXPECT_EQ(search.starts->count, 7);
  ASSERT_EQ(search.levels.size(), patient.search.levels.size());
  for (std::size_t i = 0; i < search.levels.size(); ++i) {
    const auto& ncc = std::get<NccOptions>(search.levels[i].similarity);
    const auto& own = std::get<JointCorrelationRatioOptions>(patient.search.levels[i].similarity);
    EXPECT_EQ(ncc.patches, own.patches);
    EXPECT_EQ(search.levels[i].optimizer.method, OptimizerMethod::kNelderMead);
    EXPECT_EQ(search.levels[i].optimizer.initial_step,
              patient.search.levels[i].optimizer.initial_step);
  }
  EXPECT_TRUE(std::holds_alternative<NccOptions>(methods[1].options.refinement->similarity));
  // A metric that the preset has there keeps its options.
  EXPECT_EQ(std::get<LocalLc2Options>(methods[4].options.refinement->similarity).pressed_mm,
            std::get<LocalLc2Options>(patient.refinement->similarity).pressed_mm);
  EXPECT_NE(std::get<LocalLc2Options>(patient.refinement->similarity).pressed_mm,
            LocalLc2Options{}.pressed_mm);
  EXPECT_EQ(methods[5].parallel_beams_mm, 1.5);
  EXPECT_FALSE(methods[0].parallel_beams_mm.has_value());
  RegistrationOptions unjudged = preset("thesis_a");
  unjudged.confidence.gates = GateLimits::none();
  EXPECT_EQ(registration_options_yaml(methods[5].options), registration_options_yaml(unjudged));
}

TEST_F(StudyFile, StartsMayComeFromABox) {
  const std::string box = replaced(replaced(replaced(kStudy, "  min_displacement_mm: 1\n", ""),
                                            "  max_displacement_mm: 20\n", "  box_mm: 10\n"),
                                   "max_rotation_deg: 15", "box_deg: 20");
  const Study study = read(box);
  ASSERT_TRUE(study.starts.box.has_value());
  EXPECT_EQ(study.starts.box->translation_mm, 10.0);
  EXPECT_NEAR(study.starts.box->rotation_rad, radians(20.0), 1e-12);
}

TEST_F(StudyFile, CasesBeginAtTheRoot) {
  write_text(path(), "cases: [agar_*]\nmethods: [{preset: fast}]\n");
  EXPECT_EQ(read_study(path(), folder_.path() / "cases").cases.size(), 2U);
  expect_input_error([&] { read_study(path()); }, {"'cases' has 'agar_*', must match a folder"});
}

TEST_F(StudyFile, MayBeNamedInTheFolderThatIsTheCurrentOne) {
  write_text(path(), "cases: [cas*]\nmethods: [{preset: fast}]\n");
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder_.path());
  try {
    EXPECT_EQ(read_study("study.yaml").cases, std::vector<std::filesystem::path>{"cases"});
  } catch (const InputError& error) {
    ADD_FAILURE() << error.what();
  }
  std::filesystem::current_path(before);
}

TEST_F(StudyFile, ThoseThatShipAreRead) {
  for (const std::string group :
       {"agar", "patient", "patienthard", "contrast60", "noise12", "gas50", "soundspeed3", "sweep1",
        "field50", "deformed8", "breathing8", "foragar", "forfat", "forhard"})
    for (int seed = 3001; seed <= 3007; ++seed)
      std::filesystem::create_directories(folder_.path() / "cases" /
                                          (group + "_" + std::to_string(seed)));
  std::map<std::string, std::size_t> methods;
  for (const auto& file : std::filesystem::directory_iterator(USCT_SOURCE_DIR "/studies"))
    methods[file.path().filename()] = read_study(file.path(), folder_.path()).methods.size();
  EXPECT_EQ(methods, (std::map<std::string, std::size_t>{{"calibration.yaml", 2},
                                                         {"comparison.yaml", 13},
                                                         {"mu_offset.yaml", 5},
                                                         {"robustness.yaml", 2},
                                                         {"thesis_patient.yaml", 4},
                                                         {"thesis_phantom.yaml", 3},
                                                         {"transfer.yaml", 3}}));
}

TEST_F(StudyFile, WhatIsWrongIsNamedWithItsPath) {
  expect_refused("success_mm", "succes_mm", "key 'succes_mm' is unknown");
  expect_refused("success_mm: 10", "success_mm: 0", "'success_mm' is 0");
  expect_refused("success_mm: 10", "success_mm: ten", "'success_mm'");
  expect_refused("one_at_a_time: true", "one_at_a_time: yes", "'one_at_a_time' is 'yes'");
  expect_refused("cases: [cases/agar_*, cases/patient_1]", "", "key 'cases' is missing");
  expect_refused("cases/agar_*", "cases/pig_*", "'cases' has 'cases/pig_*', must match a folder");
  expect_refused("count: 20", "starts: 20", "key 'starts.starts' is unknown");
  expect_refused("count: 20", "count: 0", "'starts.count' is 0");
  expect_refused("[3, 5]", "[3, 3]", "'starts.seeds' has '3' twice");
  expect_refused("[3, 5]", "[3, -5]", "'starts.seeds[1]' is '-5'");
  expect_refused("kinds: [start, stranger]", "kinds: [begin]", "'starts.kinds' is 'begin'");
  expect_refused("max_rotation_deg: 15", "max_rotation_deg: 200", "'starts.max_rotation_deg'");
  expect_refused("max_rotation_deg: 15", "box_mm: 15", "must not stand beside a box");
  expect_refused("preset: thesis_a", "preset: thesis_c", "'methods[2].preset' is 'thesis_c'");
  expect_refused("preset: thesis_a", "", "key 'methods[2].preset' is missing");
  expect_refused("count: 7", "count: x", "'methods[1].options.search.starts.count'");
  expect_refused("count: 7", "conut: 7", "'methods[1].options.search.starts.conut'");
  expect_refused("[ncc, local_lc2]", "[nccc]", "'methods[1].metrics' is 'nccc'");
  expect_refused("[ncc, local_lc2]", "ncc", "'methods[1].metrics' must be a list");
  expect_refused("[nelder_mead, bobyqa]", "[newton]", "'methods[1].optimizers[0]' is 'newton'");
  expect_refused("parallel_beams_mm: 1.5", "parallel_beams_mm: -1", "'parallel_beams_mm' is -1");
  expect_refused("name: scan_converted", "name: patient", "two methods are named 'patient'");
  expect_refused("name: scan_converted", "name: ../x", "a method's name is '../x'");
}

}  // namespace
}  // namespace usct::test
