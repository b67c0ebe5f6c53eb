#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "core/evaluation/small_study.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/replaced.h"
#include "core/io/temporary_folder.h"
#include "evaluation/study_results.h"
#include "us_ct_registration/evaluation/study_report.h"
#include "us_ct_registration/evaluation/study_work.h"

namespace usct::test {
namespace {

namespace fs = std::filesystem;

/// Two methods, five cases, three starts: 30 runs.
StudyPlan small_plan(const std::string& version = "1") {
  StudyPlan plan;
  plan.study.methods = {{"as_it_is", {}, {}}, {"off_by_3_mm", {}, {}}};
  plan.study.starts.starts = 3;
  plan.cases = small_cases();
  const std::vector<Trial> trials = plan_trials(plan.cases, plan.study.starts);
  for (const Trial& trial : trials)
    for (std::size_t method = 0; method < 2; ++method)
      plan.runs.push_back({method, trial, version + "_" + std::to_string(plan.runs.size())});
  return plan;
}

std::vector<Register> small_methods() {
  return {register_nothing, [](const PreScanVolume& us, const CtVolume& ct,
                               const Eigen::Isometry3d& T_us_ct_initial) {
            return register_nothing(us, ct, Eigen::Translation3d(3, 0, 0) * T_us_ct_initial);
          }};
}

/// The methods, of which the call number `last + 1` fails, as the whole process might.
std::vector<Register> methods_that_end_after(int last, std::shared_ptr<std::atomic<int>> calls) {
  std::vector<Register> methods = small_methods();
  for (Register& method : methods)
    method = [last, calls, whole = method](const PreScanVolume& us, const CtVolume& ct,
                                           const Eigen::Isometry3d& T) {
      if (++*calls > last) throw std::runtime_error("killed");
      return whole(us, ct, T);
    };
  return methods;
}

struct Outcome {
  std::vector<std::optional<StudyRun>> runs;
  std::vector<std::string> warnings;
  int registrations = 0;
};

/// Carries out the plan in a folder (or in memory); ends as a killed process after `last`
/// registrations.
Outcome carried_out(const StudyPlan& plan, const fs::path& folder, const StudyShard& shard = {},
                    int threads = 1, int last = 1000) {
  Outcome outcome;
  StudyWork work;
  work.folder = folder;
  work.shard = shard;
  work.threads = threads;
  work.warn = [&](const std::string& text) { outcome.warnings.push_back(text); };
  const auto calls = std::make_shared<std::atomic<int>>(0);
  try {
    outcome.runs =
        carry_out(plan, in_memory(plan.cases), methods_that_end_after(last, calls), work);
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "killed");
  }
  outcome.registrations = *calls;
  return outcome;
}

/// All that a study tells: tables and every run.
std::string report_of(const StudyPlan& plan, const std::vector<std::optional<StudyRun>>& known) {
  std::vector<StudyRun> runs;
  for (const std::optional<StudyRun>& run : known) {
    EXPECT_TRUE(run.has_value());
    if (run) runs.push_back(*run);
  }
  const TemporaryFolder folder;
  write_study_report(plan, runs, {}, folder.path());
  return read_text(folder.path() / "tables.md") + read_text(folder.path() / "study.json");
}

class StudyWorkTest : public testing::Test {
 protected:
  fs::path folder() const { return folder_.path() / "results"; }
  fs::path lines() const { return folder() / "runs" / "1_of_1.jsonl"; }

  const StudyPlan plan_ = small_plan();
  const std::string whole_ = report_of(plan_, carried_out(plan_, {}).runs);

 private:
  TemporaryFolder folder_;
};

TEST_F(StudyWorkTest, AStudyThatWasEndedGoesOnWhereItWas) {
  carried_out(plan_, folder(), {}, 1, 7);
  carried_out(plan_, folder(), {}, 1, 0);
  const Outcome second = carried_out(plan_, folder(), {}, 2, 11);
  EXPECT_GE(second.registrations, 11);
  const Outcome last = carried_out(plan_, folder(), {}, 3);
  EXPECT_EQ(last.registrations, 30 - 7 - 11);
  EXPECT_TRUE(last.warnings.empty());
  EXPECT_EQ(report_of(plan_, last.runs), whole_);
  const Outcome again = carried_out(plan_, folder());
  EXPECT_EQ(again.registrations, 0);
  EXPECT_EQ(report_of(plan_, again.runs), whole_);
}

// A process can die, or a disk be full, at any byte of the file.
TEST_F(StudyWorkTest, AFileThatEndsAnywhereLosesOneRunAtMost) {
  carried_out(plan_, folder(), {}, 1, 3);
  const std::string text = read_text(lines());
  for (std::size_t size = 0; size < text.size(); size += 211) {
    const std::string left = text.substr(0, size);
    write_text(lines(), left);
    const auto whole_lines = std::count(left.begin(), left.end(), '\n');
    const bool torn = !left.empty() && left.back() != '\n';
    const Outcome outcome = carried_out(plan_, folder());
    // A line that lacks nothing but its end is whole.
    const bool complete = torn && text[size] == '\n';
    EXPECT_EQ(outcome.registrations, 30 - whole_lines - (complete ? 1 : 0)) << size;
    EXPECT_EQ(outcome.warnings.size(), torn && !complete ? 1U : 0U) << size;
    EXPECT_EQ(report_of(plan_, outcome.runs), whole_) << size;
  }
}

TEST_F(StudyWorkTest, ACorruptLineIsNamedAndItsRunMadeAgain) {
  carried_out(plan_, folder());
  const std::string text = read_text(lines());
  const std::string line_2 = text.substr(text.find('\n') + 1);
  const std::string number = line_2.substr(line_2.find("displacement_mm") + 17, 6);
  for (const std::string& broken :
       {replaced(text, number, "1.2345"), replaced(text, "checksum", "checksun"),
        replaced(text, "\"kind\":\"start\"", "\"kind\":\"\0art\""), "nonsense\n" + text}) {
    write_text(lines(), broken);
    const Outcome outcome = carried_out(plan_, folder());
    ASSERT_EQ(outcome.warnings.size(), 1U);
    EXPECT_NE(outcome.warnings[0].find(lines().string() + ": line "), std::string::npos)
        << outcome.warnings[0];
    EXPECT_EQ(outcome.registrations, broken.size() > text.size() ? 0 : 1);
    EXPECT_EQ(report_of(plan_, outcome.runs), whole_);
  }
}

TEST_F(StudyWorkTest, ResultsOfAnotherStudyAreNamedAndNotUsed) {
  carried_out(small_plan("other"), folder());
  const Outcome outcome = carried_out(plan_, folder());
  EXPECT_EQ(outcome.registrations, 30);
  ASSERT_EQ(outcome.warnings.size(), 1U);
  EXPECT_NE(outcome.warnings[0].find("30 lines are of other runs"), std::string::npos);
  EXPECT_EQ(report_of(plan_, outcome.runs), whole_);
}

TEST_F(StudyWorkTest, MethodsWithTheSameOptionsShareResults) {
  StudyPlan plan = plan_;
  plan.runs[1].fingerprint = plan.runs[0].fingerprint;
  carried_out(plan, folder());
  const Outcome again = carried_out(plan, folder());
  EXPECT_EQ(again.registrations, 0);
  EXPECT_EQ(again.runs[1]->method, "off_by_3_mm");
}

TEST_F(StudyWorkTest, ShardsTogetherAreTheWhole) {
  const Outcome second = carried_out(plan_, folder(), {2, 3}, 2);
  EXPECT_EQ(second.registrations, 10);
  EXPECT_EQ(std::count_if(second.runs.begin(), second.runs.end(),
                          [](const auto& run) { return run.has_value(); }),
            10);
  carried_out(plan_, folder(), {3, 3}, 1, 4);
  carried_out(plan_, folder(), {1, 3});
  const Outcome rest = carried_out(plan_, folder());
  EXPECT_EQ(rest.registrations, 6);
  EXPECT_EQ(report_of(plan_, rest.runs), whole_);
}

TEST_F(StudyWorkTest, WritersOfOneFileLoseNothing) {
  const std::vector<std::optional<StudyRun>> runs = carried_out(plan_, {}).runs;
  fs::create_directories(folder() / "runs");
  std::vector<std::thread> writers;
  for (std::size_t writer = 0; writer < 4; ++writer)
    writers.emplace_back([&, writer] {
      for (std::size_t i = writer; i < runs.size(); i += 4)
        append_result(lines(), *runs[i], plan_.runs[i].fingerprint);
    });
  for (std::thread& writer : writers) writer.join();
  const Outcome outcome = carried_out(plan_, folder());
  EXPECT_EQ(outcome.registrations, 0);
  EXPECT_TRUE(outcome.warnings.empty());
  EXPECT_EQ(report_of(plan_, outcome.runs), whole_);
}

// Method 0 takes 2 s, method 1 6 s; four runs at the same time.
TEST_F(StudyWorkTest, TimeLeftIsThatOfTheOpenRuns) {
  StudyWork work;
  std::vector<StudyProgress> seen;
  work.progress = [&](const StudyProgress& progress) { seen.push_back(progress); };
  work.threads = 4;
  std::vector<Register> methods;
  for (const double seconds : {2.0, 6.0})
    methods.push_back([seconds](const PreScanVolume&, const CtVolume&, const Eigen::Isometry3d&) {
      RegistrationResult result;
      result.seconds = {{"total", seconds}};
      return result;
    });
  const auto runs = carry_out(plan_, in_memory(plan_.cases), methods, work);
  ASSERT_EQ(seen.size(), 31U);
  EXPECT_TRUE(std::isnan(seen[0].seconds_left));
  EXPECT_EQ(seen.back().done, 30U);
  EXPECT_EQ(seen.back().all, 30U);
  EXPECT_EQ(seen.back().seconds_left, 0.0);
  EXPECT_EQ(seen[29].done, 29U);
  EXPECT_TRUE(seen[29].seconds_left == 2.0 / 4 || seen[29].seconds_left == 6.0 / 4);
}

TEST(StudyShard, IsKOfN) {
  EXPECT_EQ(parse_shard("2/8", "--shard").number, 2);
  EXPECT_EQ(parse_shard("2/8", "--shard").count, 8);
  for (const char* text : {"", "3", "0/2", "3/2", "1/2/3", "a/2", "-1/2"})
    expect_input_error([&] { parse_shard(text, "--shard"); }, {"--shard"});
}

}  // namespace
}  // namespace usct::test
