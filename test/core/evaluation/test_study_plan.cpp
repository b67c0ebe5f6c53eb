#include <gtest/gtest.h>

#include <set>

#include "core/evaluation/small_study.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/evaluation/study.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

namespace fs = std::filesystem;

/// Three small cases in files, and a study of two methods of them.
class PlanStudy : public testing::Test {
 protected:
  void SetUp() override {
    for (const StudyCase& small :
         {small_case("a_1", 1), small_case("a_2", 2), small_case("b_1", 3)})
      write(small);
    study_.methods = {{"fast", preset("fast"), {}}, {"patient", preset("patient"), {}}};
    study_.starts.starts = 2;
  }
  fs::path folder(const std::string& name) const { return folder_.path() / name; }
  void write(const StudyCase& small) {
    fs::create_directories(folder(small.name));
    write_volume(small.ct, folder(small.name) / "ct.nrrd");
    write_prescan_nrrd(small.ultrasound, folder(small.name) / "us.nrrd");
    write_T_us_ct(small.T_us_ct_true, folder(small.name) / "truth.tfm");
    write_points_mm(small.targets_us_mm, folder(small.name) / "targets.csv");
    if (study_.cases.size() < 3) study_.cases.push_back(folder(small.name));
  }
  /// Names of the cases of which a run has another fingerprint than in `before`.
  static std::set<std::string> changed(const StudyPlan& before, const StudyPlan& after) {
    std::set<std::string> names;
    EXPECT_EQ(before.runs.size(), after.runs.size());
    for (std::size_t i = 0; i < before.runs.size(); ++i)
      if (before.runs[i].fingerprint != after.runs[i].fingerprint)
        names.insert(before.cases[before.runs[i].trial.us_case].name);
    return names;
  }

  Study study_;

 private:
  TemporaryFolder folder_;
};

TEST_F(PlanStudy, HasEveryRunByCaseMethodAndStart) {
  study_.starts.seeds = {1, 4};
  const StudyPlan plan = plan_study(study_);
  ASSERT_EQ(plan.runs.size(), 3U * 2U * 2U * 2U);
  std::set<std::string> fingerprints;
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    const PlannedRun& run = plan.runs[i];
    EXPECT_EQ(run.trial.us_case, i / 8);
    EXPECT_EQ(run.method, i / 4 % 2);
    EXPECT_EQ(run.trial.study_seed, i / 2 % 2 == 0 ? 1U : 4U);
    EXPECT_EQ(run.trial.index, static_cast<int>(i % 2));
    fingerprints.insert(run.fingerprint);
  }
  EXPECT_EQ(fingerprints.size(), plan.runs.size());
  EXPECT_TRUE(plan.cases[0].ct.voxels.empty());
  EXPECT_EQ(plan.cases[2].targets_us_mm.size(), 4U);
}

TEST_F(PlanStudy, FingerprintsChangeWithAllThatDeterminesARun) {
  const StudyPlan plan = plan_study(study_);
  EXPECT_TRUE(changed(plan, plan_study(study_)).empty());
  const std::set<std::string> all{"a_1", "a_2", "b_1"};

  StudyCase other = small_case("a_2", 2);
  other.ct.voxels[7] += 1;
  write(other);
  EXPECT_EQ(changed(plan, plan_study(study_)), std::set<std::string>{"a_2"});
  other = small_case("a_2", 2);
  other.ct.grid.origin_mm.x() += 0.25;
  write(other);
  EXPECT_EQ(changed(plan, plan_study(study_)), std::set<std::string>{"a_2"});
  other = small_case("a_2", 2);
  other.ultrasound.voxels[5] += 1;
  write(other);
  EXPECT_EQ(changed(plan, plan_study(study_)), std::set<std::string>{"a_2"});
  write(small_case("a_2", 2));
  EXPECT_TRUE(changed(plan, plan_study(study_)).empty());

  Study varied = study_;
  varied.methods[1].options.seed = 9;
  const StudyPlan of_options = plan_study(varied);
  for (std::size_t i = 0; i < plan.runs.size(); ++i)
    EXPECT_EQ(plan.runs[i].fingerprint == of_options.runs[i].fingerprint, plan.runs[i].method == 0);
  varied = study_;
  varied.methods[0].name = "renamed";
  varied.success_mm = 3.0;
  EXPECT_TRUE(changed(plan, plan_study(varied)).empty());
  varied.starts.seeds = {2};
  EXPECT_EQ(changed(plan, plan_study(varied)), all);
  varied = study_;
  varied.how = StudyThreads::kWithinTrial;
  EXPECT_EQ(changed(plan, plan_study(varied)), all);
}

TEST_F(PlanStudy, CasesAreReadWithTheirVoxels) {
  const CaseSource cases = case_reader(study_);
  EXPECT_EQ(cases(1)->ct.voxels, small_case("a_2", 2).ct.voxels);
  EXPECT_EQ(cases(1).get(), cases(1).get());
  EXPECT_EQ(cases(2)->name, "b_1");
}

TEST_F(PlanStudy, RefusesStudiesThatCannotBe) {
  study_.methods[1].name = "fast";
  expect_input_error([&] { plan_study(study_); }, {"two methods are named 'fast'"});
  study_.methods.clear();
  expect_input_error([&] { plan_study(study_); }, {"'methods' is empty"});
}

}  // namespace
}  // namespace usct::test
