#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "core/io/file_size_limit.h"
#include "core/tools/run_usct.h"

namespace usct::test {
namespace {

/// Two tiny phantoms, made once.
class Study : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    for (const std::string seed : {"1", "2"}) {
      const Outcome outcome = run_usct({"phantom",
                                        "--quiet",
                                        "--scene",
                                        "agar",
                                        "--seed",
                                        seed,
                                        "--output",
                                        path("agar_" + seed),
                                        "--size",
                                        "60",
                                        "32",
                                        "24",
                                        "--ct-size",
                                        "70",
                                        "56",
                                        "36",
                                        "--ct-spacing",
                                        "3",
                                        "3",
                                        "4",
                                        "--ct-format",
                                        seed == "1" ? "nrrd" : "nii.gz"});
      ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
    }
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string path(const std::string& name) { return (folder_->path() / name).string(); }

  static Outcome study(const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"study", path("agar_1"), path("agar_2"), "--preset",
                                       "fast",  "--quiet",      "--output",     path("study.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  }
  /// The JSON of the last study, without the entries that differ from run to run.
  static nlohmann::json runs() {
    auto json = nlohmann::json::parse(read_text(path("study.json")));
    for (auto& run : json["runs"])
      for (const char* cost : {"seconds", "peak_memory_mib"}) run.erase(cost);
    return json["runs"];
  }

 private:
  static TemporaryFolder* folder_;
};
TemporaryFolder* Study::folder_ = nullptr;

TEST_F(Study, RegistersFromEveryStartAndDrawsTheWorst) {
  const Outcome outcome = study({"--starts", "3", "--max-displacement", "9", "--pictures",
                                 path("pictures"), "--thesis-table"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_NE(outcome.output.find("| agar | 6 | "), std::string::npos) << outcome.output;
  EXPECT_NE(outcome.output.find("from 6-9 mm"), std::string::npos) << outcome.output;
  EXPECT_NE(outcome.output.find("| agar_2 | 3 | "), std::string::npos) << outcome.output;
  ASSERT_EQ(runs().size(), 6U);
  for (const auto& run : runs()) {
    EXPECT_NEAR(run["before_tre_mm"]["mean"].get<double>(), run["displacement_mm"].get<double>(),
                1e-6);
    EXPECT_LE(run["displacement_mm"].get<double>(), 9.0);
  }
  EXPECT_TRUE(std::filesystem::exists(path("pictures") + "/worst_agar/before_after.png"));
}

TEST_F(Study, DoesNotDependOnThreads) {
  ASSERT_EQ(study({"--starts", "2", "--threads", "1"}).exit_status, 0);
  const nlohmann::json one = runs();
  ASSERT_EQ(study({"--starts", "2", "--threads", "3"}).exit_status, 0);
  EXPECT_EQ(runs(), one);
  ASSERT_EQ(study({"--starts", "2", "--threads", "2", "--time"}).exit_status, 0);
  EXPECT_EQ(runs(), one);
  ASSERT_EQ(study({"--starts", "2", "--seed", "2"}).exit_status, 0);
  EXPECT_NE(runs(), one);
}

TEST_F(Study, NegativesAreListedByKind) {
  const Outcome outcome = study({"--starts", "1", "--negatives"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  for (const char* kind : {"mismatched", "mirrored", "no overlap", "noise", "far start",
                           "frames reversed", "half turn", "ct mirrored", "ct axes swapped"})
    EXPECT_NE(outcome.output.find("| " + std::string(kind) + " | 2 | "), std::string::npos)
        << outcome.output;
  // None of two: (1 - p)^2 = 0.05.
  EXPECT_NE(outcome.output.find("| no overlap | 2 | 2 (no_overlap 2) | - | 0 | 0.0, 77.64 |"),
            std::string::npos)
      << outcome.output;
  EXPECT_EQ(outcome.output.find("stranger"), std::string::npos) << outcome.output;
}

TEST_F(Study, OnlyTheKindsThatAreNamedWithStrangersCts) {
  const std::filesystem::path stranger = path("stranger_9");
  std::filesystem::create_directory(stranger);
  for (const char* name : {"ct.nrrd", "targets_ct.csv"})
    std::filesystem::copy_file(path("agar_1") + "/" + name, stranger / name);
  const Outcome outcome = study({"--starts", "1", "--kinds", "stranger,frames-reversed,start",
                                 "--strangers", stranger.string()});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  for (const char* row : {"| stranger | 2 | ", "| frames reversed | 2 | ", "| agar | 2 | "})
    EXPECT_NE(outcome.output.find(row), std::string::npos) << outcome.output;
  EXPECT_EQ(outcome.output.find("mirrored"), std::string::npos) << outcome.output;
  ASSERT_EQ(runs().size(), 6U);
  for (const auto& run : runs())
    EXPECT_EQ(run["ct_case"],
              run["kind"] == "stranger" ? nlohmann::json("stranger_9") : run["case"]);
}

TEST_F(Study, StartsFromABoxOfParallelBeams) {
  const Outcome outcome =
      study({"--starts", "2", "--box-mm", "4", "--box-deg", "3", "--parallel-beams", "2"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(runs().size(), 4U);
}

/// The names of all files below a folder.
std::set<std::string> files_below(const std::string& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) names.insert(entry.path().filename());
  return names;
}

/// What a study says that a full disk has ended. The tables on standard output have room.
void expect_full_disk(const Outcome& outcome, const std::string& file) {
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_NE(outcome.errors.find("usct: failed: " + file + ": writing failed: "), std::string::npos)
      << outcome.errors;
}

TEST_F(Study, AFullDiskIsAFailureThatLeavesNoHalfFile) {
  const std::string json = path("full/study.json");
  std::filesystem::create_directory(path("full"));
  const auto study_in_full = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{
        "study", path("agar_1"), "--preset", "fast", "--quiet", "--starts", "1", "--output", json};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  };
  {
    const FileSizeLimit full(8192);
    expect_full_disk(study_in_full({}), json);
  }
  EXPECT_TRUE(files_below(path("full")).empty());
  ASSERT_EQ(study_in_full({}).exit_status, 0);
  const std::string earlier = read_text(json);
  {
    const FileSizeLimit full(8192);
    expect_full_disk(study_in_full({}), json);
  }
  EXPECT_TRUE(read_text(json) == earlier);
  // There is room for the JSON, but not for a picture.
  const Outcome with_pictures = [&] {
    const FileSizeLimit full(earlier.size() + 8192);
    return study_in_full({"--pictures", path("full/pictures")});
  }();
  expect_full_disk(with_pictures, path("full/pictures/worst_agar/before_after.png"));
  EXPECT_EQ(files_below(path("full")), std::set<std::string>{"study.json"});
}

/// A study file of both phantoms, two methods and six starts: 24 runs.
class StudyOfAFile : public Study {
 protected:
  void SetUp() override {
    write_text(path("file.yaml"),
               "cases: [agar_*]\n"
               "methods: [{preset: fast}, {name: one, preset: fast, judged: false}]\n"
               "starts: {count: 6, max_displacement_mm: 9}\n");
    for (const char* folder : {"whole", "parts", "file"}) std::filesystem::remove_all(path(folder));
  }
  static Outcome carry_out(const std::string& folder, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"study", path("file.yaml"), "--output", path(folder)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  }
  static std::string tables(const std::string& folder) {
    return read_text(path(folder) + "/tables.md");
  }
};

TEST_F(StudyOfAFile, EndedByForceAndBegunAgainHasTheSameTable) {
  const Outcome whole = carry_out("whole", {"--threads", "2"});
  ASSERT_EQ(whole.exit_status, 0) << whole.errors;
  EXPECT_NE(whole.errors.find("24 of 24 runs"), std::string::npos) << whole.errors;
  EXPECT_NE(tables("whole").find("| fast | 2 | 2 | 12 | "), std::string::npos) << tables("whole");
  EXPECT_NE(whole.output.find(tables("whole")), std::string::npos);
  const std::string killed = "timeout --signal=KILL 0.3 '" USCT_TOOL "' study '" +
                             path("file.yaml") + "' --quiet --threads 1 --output '" +
                             path("parts") + "'";
  EXPECT_NE(std::system((killed + " > /dev/null 2>&1").c_str()), 0);
  EXPECT_EQ(tables("parts"), "");
  const Outcome rest = carry_out("parts", {"--threads", "3"});
  ASSERT_EQ(rest.exit_status, 0) << rest.errors;
  EXPECT_EQ(tables("parts"), tables("whole"));
}

/// The line in which the disk was full is no result. The study goes on once there is room.
TEST_F(StudyOfAFile, GoesOnAfterAFullDisk) {
  ASSERT_EQ(carry_out("whole", {"--quiet"}).exit_status, 0);
  const std::string lines = path("parts") + "/runs/1_of_1.jsonl";
  {
    const FileSizeLimit full(32768);
    expect_full_disk(carry_out("parts", {"--quiet"}), lines);
  }
  EXPECT_EQ(files_below(path("parts")), std::set<std::string>{"1_of_1.jsonl"});
  const Outcome rest = carry_out("parts", {"--quiet"});
  EXPECT_EQ(rest.exit_status, 0);
  EXPECT_NE(rest.errors.find("is not a whole result; its run is made again"), std::string::npos)
      << rest.errors;
  EXPECT_EQ(tables("parts"), tables("whole"));
}

TEST_F(StudyOfAFile, ShardsHaveTheSameTableAsTheWhole) {
  const Outcome second = carry_out("parts", {"--shard", "2/2", "--quiet"});
  ASSERT_EQ(second.exit_status, 0) << second.errors;
  EXPECT_NE(second.output.find("12 of 24 runs of the study are done"), std::string::npos);
  EXPECT_EQ(carry_out("parts", {"--shard", "1/2", "--quiet"}).exit_status, 0);
  ASSERT_EQ(carry_out("whole", {"--quiet"}).exit_status, 0);
  EXPECT_EQ(tables("parts"), tables("whole"));
}

TEST_F(StudyOfAFile, AChangedCaseIsRegisteredAgain) {
  ASSERT_EQ(carry_out("parts", {"--quiet"}).exit_status, 0);
  const std::string targets = read_text(path("agar_2/targets.csv"));
  write_text(path("agar_2/targets.csv"), targets + "\n");
  const Outcome outcome = carry_out("parts", {"--quiet"});
  write_text(path("agar_2/targets.csv"), targets);
  EXPECT_NE(outcome.errors.find("12 lines are of other runs"), std::string::npos) << outcome.errors;
}

TEST_F(StudyOfAFile, WritesBelowTheFileByDefaultAndDrawsTheWorstOfEachMethod) {
  const Outcome outcome =
      run_usct({"study", path("file.yaml"), "--quiet", "--pictures", path("worst")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  const auto json = nlohmann::json::parse(read_text(path("file/study.json")));
  ASSERT_EQ(json["pictures"].size(), 2U);
  for (const auto& picture : json["pictures"])
    EXPECT_TRUE(std::filesystem::exists(path("file/" + picture["folder"].get<std::string>()) +
                                        "/before_after.png"));
  EXPECT_EQ(json["runs"].size(), 24U);
}

TEST_F(StudyOfAFile, OptionsOfTheOtherKindOfStudyAreRefused) {
  const auto refused = [](const Outcome& outcome, const std::string& named) {
    EXPECT_EQ(outcome.exit_status, 2);
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  };
  refused(carry_out("parts", {"--starts", "3"}), "--starts: belongs into the study file");
  refused(carry_out("parts", {"--shard", "3/2"}), "--shard: is 3/2");
  refused(carry_out("parts", {path("agar_1")}), "must be given alone");
  refused(study({"--shard", "1/2"}), "--shard: is for a study file");
}

TEST_F(Study, BadArgumentsEndWithStatusTwo) {
  const auto refused = [](const std::vector<std::string>& more, const std::string& named) {
    const Outcome outcome = study(more);
    EXPECT_EQ(outcome.exit_status, 2) << outcome.errors;
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  };
  refused({"--starts", "0"}, "'starts' (--starts) is 0");
  refused({"--box-mm", "4", "--max-displacement", "10"}, "excludes");
  refused({path("agar_3")}, "agar_3");
  refused({"--kinds", "noise,backwards"},
          "--kinds: is 'backwards', must be one of start, mismatched, mirrored");
  refused({"--kinds", "noise", "--negatives"}, "excludes");
  refused({"--kinds", "stranger"}, "strangers");
  refused({"--strangers", path("agar_3"), "--kinds", "stranger"}, "agar_3");
  refused({path("agar_1")}, "two are named 'agar_1'");
  const Outcome unknown = run_usct({"study", path("agar_1"), "--preset", "best"});
  EXPECT_EQ(unknown.exit_status, 2);
  EXPECT_NE(unknown.errors.find("best"), std::string::npos) << unknown.errors;
  const Outcome no_folder =
      run_usct({"study", path("agar_1"), "--output", path("absent/study.json")});
  EXPECT_EQ(no_folder.exit_status, 2);
  EXPECT_NE(no_folder.errors.find("--output"), std::string::npos) << no_folder.errors;
  refused({path("absent")}, "absent");
  const Outcome absent = run_usct({"study", path("absent.yaml")});
  EXPECT_EQ(absent.exit_status, 2);
  EXPECT_NE(absent.errors.find("absent.yaml: does not exist"), std::string::npos) << absent.errors;
  refused({"--box-mm", "nan"}, "--box-mm: is 'nan', must be finite");
  // Before the work: the JSON of an earlier study stays.
  std::ofstream(path("study.json")) << "earlier";
  refused({"--pictures", path("agar_1/ct.nrrd")}, "--pictures");
  EXPECT_EQ(read_text(path("study.json")), "earlier");
  const Outcome image =
      run_usct({"study", path("agar_1"), "--output", path("agar_1/ct.nrrd"), "--quiet"});
  EXPECT_EQ(image.exit_status, 2);
  EXPECT_NE(image.errors.find("must end in .json"), std::string::npos) << image.errors;
}

}  // namespace
}  // namespace usct::test
