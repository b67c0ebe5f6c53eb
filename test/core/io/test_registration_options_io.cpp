#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <regex>
#include <set>
#include <sstream>

#include "core/io/any_registration_options.h"
#include "core/io/bad_files.h"
#include "core/io/replaced.h"
#include "test_paths.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/options/registration_options_io.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::replaced;
using test::slurp;
using test::spit;
using test::TemporaryFolder;
using namespace std::string_literals;

const std::filesystem::path kSourceFolder = USCT_SOURCE_DIR;

RegistrationOptions parse(const std::string& yaml) {
  return parse_registration_options(yaml, "options.yaml");
}

/// Expects the text to be refused with a message that names the file and every one of `named`.
void expect_refused(const std::string& yaml, std::vector<std::string> named) {
  SCOPED_TRACE(yaml);
  named.emplace_back("options.yaml: ");
  expect_input_error([&] { parse(yaml); }, named);
}

/// Compares by text, in which every number has all its digits but the last of angles in degrees.
bool same(const RegistrationOptions& a, const RegistrationOptions& b) {
  const auto angle = [](const RegistrationOptions& o) {
    return o.search.starts ? o.search.starts->rotation_rad : 0.0;
  };
  const auto text = [](RegistrationOptions o) {
    if (o.search.starts) o.search.starts->rotation_rad = 0.0;
    return registration_options_yaml(o);
  };
  const auto near = [](double x, double y) { return std::abs(x - y) <= 1e-15 * x; };
  return text(a) == text(b) && near(angle(a), angle(b));
}

RC_GTEST_PROP(RegistrationOptionsIo, EveryFieldComesBackFromAFile, ()) {
  const RegistrationOptions options = test::any_options();
  const TemporaryFolder folder;
  const RegistrationOptions back = read_registration_options(
      spit(folder.path() / "options.yaml", registration_options_yaml(options)));
  RC_ASSERT(same(options, back));
}

/// The text holds every field of any options, so that different options have different texts.
RC_GTEST_PROP(RegistrationOptionsIo, NoTwoOptionsHaveTheSameText, ()) {
  RC_ASSERT(registration_options_yaml(test::any_options()) !=
            registration_options_yaml(test::any_options()));
}

RC_GTEST_PROP(RegistrationOptionsIo, TheListHoldsEveryScalarOfTheText, ()) {
  const RegistrationOptions options = test::any_options();
  const std::string yaml = registration_options_yaml(options);
  std::size_t scalars = 0;
  for (std::size_t at = yaml.find(": "); at != std::string::npos; at = yaml.find(": ", at + 1))
    ++scalars;
  RC_ASSERT(registration_options_text(options).size() == scalars);
}

TEST(RegistrationOptionsIo, TheListNamesWholePaths) {
  const auto list = registration_options_text(preset("patient"));
  EXPECT_EQ(list.at("search.starts.rotation_deg").substr(0, 2), "25");
  EXPECT_EQ(list.at("search.levels[1].similarity.kind"), "joint_correlation_ratio");
  EXPECT_EQ(list.at("refinement.optimizer.method"), "gauss_newton");
  EXPECT_EQ(registration_options_text(preset("thesis_b")).at("refinement"), "none");
  EXPECT_EQ(list.at("conditioning.depth.automatic"), "true");
}

TEST(Presets, EachIsItsFileAndLoads) {
  std::vector<std::string> files;
  for (const auto& entry :
       std::filesystem::directory_iterator(kSourceFolder / "config" / "presets")) {
    const std::string name = entry.path().stem();
    SCOPED_TRACE(name);
    files.push_back(name);
    const auto bytes = slurp(entry.path());
    EXPECT_EQ(preset_yaml(name), std::string(bytes.begin(), bytes.end()));
    EXPECT_TRUE(same(preset(name), read_registration_options(entry.path())));
    EXPECT_EQ(preset_yaml(name).substr(0, 2), "# ") << "says first what it is for";
  }
  std::sort(files.begin(), files.end());
  EXPECT_EQ(files, preset_names());
  EXPECT_GE(files.size(), 6U);
}

TEST(Presets, OfOtherNamesAreRefused) {
  expect_input_error([] { preset("patiant"); }, {"patiant", "fast", "patient", "thesis_b"});
  expect_refused("preset: patiant\n", {"'preset'", "patiant", "thesis_b"});
  expect_refused("preset: [patient]\n", {"'preset'"});
}

TEST(Presets, AFileChangesOnlyWhatItHolds) {
  RegistrationOptions expected = preset("patient");
  EXPECT_TRUE(same(parse("preset: patient\n"), expected));
  expected.window.high_hu = 300;
  expected.conditioning.depth.max_mm = 90.5;
  expected.seed = 4294967295U;
  EXPECT_TRUE(same(parse("preset: patient\nwindow:\n  high_hu: 300\nseed: 4294967295\n"
                         "conditioning: {depth: {max_mm: 90.5}}\n"),
                   expected));
}

/// The preset `patient` equals the defaults in the header, so that there is one set of defaults.
TEST(Presets, PatientIsWhatTheHeaderSays) {
  EXPECT_EQ(registration_options_yaml(RegistrationOptions()),
            registration_options_yaml(preset("patient")));
}

/// Presets differ in how they search, and not in what they believe.
TEST(Presets, AllHaveTheSameGates) {
  for (const std::string& name : preset_names()) {
    const GateLimits gates = preset(name).confidence.gates;
    EXPECT_EQ(gates.min_overlap, GateLimits().min_overlap) << name;
    EXPECT_EQ(gates.max_wrong_probability, GateLimits().max_wrong_probability) << name;
  }
}

TEST(Presets, LevelsAreChangedByNumberLeftOutOrReplaced) {
  RegistrationOptions expected = preset("patient");
  ASSERT_EQ(expected.search.levels.size(), 2U);
  expected.search.levels[1].optimizer.initial_step = 1.5;
  expected.search.starts->rotation_rad = 10.0 * kDegree;
  EXPECT_TRUE(same(parse("preset: patient\nsearch:\n  levels:\n    1: {optimizer: {initial_step: "
                         "1.5}}\n  starts: {rotation_deg: 10}\n"),
                   expected));
  expected = preset("patient");
  expected.search.levels.erase(expected.search.levels.begin());
  expected.search.starts.reset();
  expected.refinement.reset();
  EXPECT_TRUE(same(parse("preset: patient\nsearch: {levels: {0: none}, starts: none}\n"
                         "refinement: none\n"),
                   expected));
  expected = preset("fast");
  expected.search.levels = {preset("patient").search.levels[1]};
  const std::string all = registration_options_yaml(expected);
  const std::string levels =
      all.substr(all.find("  levels:"), all.find("  rounds") - all.find("  levels:"));
  EXPECT_TRUE(same(parse("preset: fast\nsearch:\n" + levels), expected));
}

TEST(Presets, AnotherMetricNeedsAllOfItsKeys) {
  RegistrationOptions expected = preset("patient");
  NccOptions ncc;
  ncc.patches = {1, 2, 3, 0.5, SampleSubset::kAll};
  expected.search.levels[0].similarity = ncc;
  expected.search.levels[0].optimizer.method = OptimizerMethod::kBobyqa;
  const std::string patches =
      "patches: {depth_mm: 1, lateral_mm: 2, elevation_mm: 3, least_share: 0.5";
  const auto with = [](const std::string& similarity) {
    return "preset: patient\nsearch: {levels: {0: {similarity: {" + similarity +
           "}, optimizer: {method: bobyqa}}}}\n";
  };
  EXPECT_TRUE(same(parse(with("kind: ncc, " + patches + ", samples: all}")), expected));
  expect_refused(with("kind: ncc"), {"'search.levels[0].similarity.patches' is missing"});
  expect_refused(with("kind: ncc, " + patches + "}"),
                 {"'search.levels[0].similarity.patches.samples' is missing"});
}

/// An option of another metric is refused as well.
TEST(Presets, AnOptionThatTheMetricDoesNotHaveIsRefused) {
  expect_refused("preset: patient\nsearch: {levels: {0: {similarity: {power: 2}}}}\n",
                 {"'search.levels[0].similarity.power' is unknown",
                  "joint_correlation_ratio has no such option"});
  expect_refused("preset: patient\nrefinement: {similarity: {bins: 12}}\n",
                 {"'refinement.similarity.bins' is unknown", "local_lc2 has no such option"});
  // The scalar reference is available to tests only.
  expect_refused("preset: patient\nrefinement: {similarity: {scalar: true}}\n",
                 {"'refinement.similarity.scalar' is unknown"});
}

TEST(RegistrationOptionsIo, AFileWithoutAPresetMustBeComplete) {
  const std::string whole = registration_options_yaml(preset("patient"));
  EXPECT_NO_THROW(parse(whole));
  const std::string hint = "only a file with 'preset: NAME' may leave keys out";
  expect_refused(replaced(whole, "  high_hu: 400\n", ""), {"'window.high_hu' is missing", hint});
  expect_refused(replaced(whole, "        gradient_bins: 8\n", ""),
                 {"'search.levels[0].similarity.gradient_bins'", hint});
  expect_refused(replaced(whole, "        kind: joint_correlation_ratio\n", ""),
                 {"'search.levels[0].similarity.kind'", hint});
  expect_refused(replaced(whole, "    - spacing_mm: 2\n      similarity:", "    - similarity:"),
                 {"'search.levels[1].spacing_mm' is missing", hint});
  // A list of levels consists of complete levels, whatever preset the file derives from; so do a
  // refinement and starts where the preset has none.
  expect_refused("preset: patient\nsearch: {levels: [{spacing_mm: 2}]}\n",
                 {"'search.levels[0].similarity'"});
  expect_refused("preset: thesis_b\nsearch: {starts: {count: 8}}\n", {"'search.starts.region'"});
  expect_refused("preset: thesis_b\nrefinement: {spacing_mm: 1}\n", {"'refinement.similarity'"});
}

TEST(RegistrationOptionsIo, UnknownAndRepeatedKeysAreNamedWithTheirPath) {
  const auto derived = [](const std::string& rest) { return "preset: patient\n" + rest; };
  expect_refused(derived("sed: 4\n"), {"'sed' is unknown"});
  expect_refused(derived("conditioning: {depth: {min: 4}}\n"),
                 {"'conditioning.depth.min' is unknown"});
  expect_refused(derived("refinement: {optimizer: {seed: 4}}\n"),
                 {"'refinement.optimizer.seed' is unknown"});
  expect_refused(derived("seed: 4\nseed: 4\n"), {"'seed' is given twice"});
  expect_refused(derived("search: {levels: {1: {kept: 1, kept: 2}}}\n"),
                 {"'search.levels[1].kept' is given twice"});
  expect_refused(derived("search: {levels: {2: {kept: 1}}}\n"),
                 {"'search.levels'", "'2'", "within [0, 1]"});
  expect_refused(derived("search: {levels: {fine: {kept: 1}}}\n"), {"'search.levels'", "fine"});
}

/// As `{seed: 3}` is, below the preset that a request names.
TEST(RegistrationOptionsIo, AKeyThatIsNoWordIsNamed) {
  expect_refused("preset: patient\n{seed: 3}",
                 {"has the key '{seed: 3}', must be a single word, as in 'key: value'"});
}

TEST(RegistrationOptionsIo, WrongTypesAreNamedWithTheirPath) {
  const auto level = [](const std::string& rest) {
    return "preset: patient\nsearch: {levels: {1: {" + rest + "}}}\n";
  };
  expect_refused(level("kept: two"), {"'search.levels[1].kept'", "two", "whole number"});
  expect_refused(level("kept: 1.5"), {"'search.levels[1].kept'", "1.5"});
  expect_refused(level("spacing_mm: [1]"), {"'search.levels[1].spacing_mm'", "single value"});
  expect_refused(level("spacing_mm: .nan"), {"'search.levels[1].spacing_mm'", ".nan"});
  expect_refused(level("similarity: local_lc2"), {"'search.levels[1].similarity'"});
  expect_refused(level("similarity: {kind: lc3}"),
                 {"'search.levels[1].similarity.kind' is 'lc3'", "local_lc2", "mattes_mi"});
  expect_refused("preset: patient\nrefinement: {similarity: {weighting: most}}\n",
                 {"'refinement.similarity.weighting' is 'most'", "deviation"});
  expect_refused("preset: patient\nrefinement: {similarity: {positive_gradient: 1}}\n",
                 {"'refinement.similarity.positive_gradient'", "true"});
  expect_refused("preset: patient\nbeams: bent\n", {"'beams' is 'bent'", "any, parallel"});
  expect_refused(level("optimizer: {method: newton}"),
                 {"'search.levels[1].optimizer.method' is 'newton'", "bobyqa"});
  for (const std::string& text :
       {level("similarity: {kind: ncc, patches: {depth_mm: 9, lateral_mm: 9, elevation_mm: 9, "
              "least_share: 0.5, samples: all}}"),
        std::string("preset: patient\nrefinement: {similarity: {channel: along_beam}, "
                    "optimizer: {method: gauss_newton}}\n"),
        std::string("preset: patient\nconfidence: {ridge_similarity: {channel: along_beam}, "
                    "parts: {optimizer: {method: gauss_newton}}}\n")})
    expect_refused(text, {"optimizer.method' is 'gauss_newton'", "no derivatives"});
  // Older versions had it.
  expect_refused("preset: patient\nrefinement: {depth_error: 0.01}\n",
                 {"'refinement.depth_error' is unknown"});
  expect_refused("preset: thesis_b\nconfidence: {evidence: own}\n",
                 {"'search.levels[0].similarity' is simulated_lc2", "no evidence", "patient"});
  for (const std::string similarity : {"similarity", "ridge_similarity"})
    expect_refused("preset: patient\nconfidence: {" + similarity +
                       ": {kind: ncc, patches: {depth_mm: 9, lateral_mm: 9, elevation_mm: 9, "
                       "least_share: 0.5, samples: all}}, parts: {optimizer: {method: bobyqa}}}\n",
                   {"'confidence." + similarity + "' is ncc", "no evidence", "sum over patches"});
  expect_refused(level("screened: 3"), {"'search.levels[1].screened' is 3", "optimised"});
  for (const char* seed : {"-1", "4294967296", "0.5", "x"})
    expect_refused("preset: patient\nseed: " + std::string(seed) + "\n", {"'seed'", seed});
  expect_refused("preset: patient\nsearch: {levels: 3}\n", {"'search.levels' must be a list"});
  expect_refused("- preset\n", {"key: value"});
  expect_refused("window: {\n", {"not valid YAML"});
  expect_refused("window: {}\n---\nwindow: {}\n", {"has 2 documents"});
}

TEST(RegistrationOptionsIo, ValuesOutOfRangeAreNamedWithTheirPath) {
  const auto search = [](const std::string& rest) {
    return "preset: patient\nsearch: {" + rest + "}\n";
  };
  const auto level = [&](const std::string& rest) { return search("levels: {0: {" + rest + "}}"); };
  expect_refused(level("optimizer: {initial_step: -3}"),
                 {"'search.levels[0].optimizer.initial_step' is -3", "> 0"});
  expect_refused(level("spacing_mm: 1"), {"'search.levels[1].spacing_mm' is 2", "coarse to fine"});
  expect_refused(level("spacing_mm: none"), {"'search.levels[1].spacing_mm' is 2"});
  expect_refused(level("optimizer: {initial_step: 0.1}"),
                 {"'search.levels[0].optimizer.step_tolerance'"});
  expect_refused(level("similarity: {bins: 7}"),
                 {"'search.levels[0].similarity.bins' is 7", "[8, 128]"});
  expect_refused(level("similarity: {patches: {samples: some}}"),
                 {"'search.levels[0].similarity.patches.samples' is 'some'", "all, half"});
  expect_refused(level("similarity: {patches: {least_share: 0}}"),
                 {"'search.levels[0].similarity.patches.least_share' is 0"});
  expect_refused(search("starts: {count: 0}"), {"'search.starts.count' is 0", "[1, 1e+06]"});
  expect_refused(search("starts: {rotation_deg: 104}"),
                 {"'search.starts.rotation_deg' is 104", "[0, 103.92]"});
  expect_refused(search("starts: {rotation_deg: -1}"), {"'search.starts.rotation_deg' is -1"});
  EXPECT_NO_THROW(parse(search("starts: {rotation_deg: 180, region: ball}")));
  expect_refused(search("rounds: 33"), {"'search.rounds' is 33", "[1, 32]"});
  expect_refused("preset: patient\nconfidence: {gates: {min_overlap: 2}}\n",
                 {"'confidence.gates.min_overlap' is 2"});
  expect_refused("preset: patient\nconfidence: {gates: {max_scatter_mm: 0.5}}\n",
                 {"'confidence.gates.max_scatter_mm' is unknown"});
  expect_refused("preset: patient\nconfidence: {evidence: mine}\n",
                 {"'confidence.evidence' is 'mine'", "own, own_first, patient"});
  expect_refused("preset: patient\nwindow: {low_hu: 401}\n", {"'window.low_hu' is 401"});
  expect_refused("preset: patient\nconditioning: {depth: {near_field_mm: -1}}\n",
                 {"'conditioning.depth.near_field_mm' is -1"});
  expect_refused("preset: patient\nsearch: {levels: []}\n", {"levels"});
  expect_refused("preset: patient\nsearch: {levels: {0: none, 1: none}}\n", {"levels"});
}

TEST(RegistrationOptionsIo, FilesThatCannotBeReadAreNamed) {
  const TemporaryFolder folder;
  expect_input_error([&] { read_registration_options(folder.path() / "absent.yaml"); },
                     {"absent.yaml", "does not exist"});
  expect_input_error([&] { read_registration_options(spit(folder.path() / "o.yaml", "a: {"s)); },
                     {"o.yaml", "not valid YAML"});
}

TEST(RegistrationOptionsIo, EveryKeyIsDocumented) {
  const auto bytes = slurp(kSourceFolder / "docs" / "registration_options.md");
  const std::string docs(bytes.begin(), bytes.end());
  std::set<std::string> keys;
  for (const std::string& name : preset_names())
    for (const auto& [path, value] : registration_options_text(preset(name))) keys.insert(path);
  for (const std::string& name : similarity_names()) {
    RegistrationOptions options;
    options.confidence.similarity = similarity_named(name, "test");
    for (const auto& [path, value] : registration_options_text(options)) keys.insert(path);
  }
  for (std::string key : keys) {
    key = std::regex_replace(key, std::regex(R"(^search\.levels\[\d+\]\.)"), "");
    // Similarities and optimizers have the same keys everywhere.
    key = std::regex_replace(key, std::regex(R"(^.*\b(?:ridge_)?(similarity|optimizer)\.)"), "$1.");
    EXPECT_NE(docs.find("`" + key + "`"), std::string::npos) << key;
  }
}

}  // namespace
}  // namespace usct
