#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "core/tools/run_usct.h"
#include "test_data.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

/// What `usct` says of mistakes on its command line.
class OptionErrors : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  /// Expects that usct refuses, and that what it says begins with "usct: error: " and `beginning`.
  static void expect_error(const std::vector<std::string>& arguments,
                           const std::string& beginning) {
    const Outcome outcome = run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 2) << outcome.errors;
    EXPECT_EQ(outcome.errors.substr(0, 13 + beginning.size()), "usct: error: " + beginning);
    EXPECT_EQ(outcome.output, "");
  }
  static void expect_part(const Outcome& outcome, const std::string& part) {
    EXPECT_NE(outcome.errors.find(part), std::string::npos) << part << "\n" << outcome.errors;
  }

  /// A cube of a CT around the point, and ultrasound around (0, 70, 0) mm.
  void write_ct(const Eigen::Vector3d& centre_mm, std::int16_t hu = 100) const {
    Grid grid;
    grid.size = {40, 40, 40};
    grid.origin_mm = centre_mm - Eigen::Vector3d::Constant(19.5);
    CtVolume ct(grid, hu);
    ct.voxels.front() = -1024;
    write_volume(ct, path("ct.nrrd"));
  }
  void write_us() const {
    PreScanVolume us;
    us.geometry.axial = {60, 5.0, 1.0};
    us.geometry.array = CurvilinearArray{40.0, centred_table(48, 1.2 * kDegree)};
    us.geometry.motion = MotorSweep{27.25, centred_table(40, 1.4634 * kDegree), 0.0};
    for (int i = 0; i < 60 * 48 * 40; ++i) us.voxels.push_back(static_cast<std::uint8_t>(i % 251));
    write_prescan_nrrd(us, path("us.nrrd"));
  }

  TemporaryFolder folder_;
};

TEST_F(OptionErrors, AValueOfTheWrongTypeIsNamedWithWhatItMustBe) {
  const std::string whole = "must be a whole number from 0 to 4294967295\n";
  expect_error({"register", "--seed", "-1"}, "--seed: is '-1', " + whole);
  expect_error({"phantom", "--output", path("x"), "--seed", "1.5"}, "--seed: is '1.5', " + whole);
  expect_error({"phantom", "--output", path("x"), "--seed", "5000000000"},
               "--seed: is '5000000000', " + whole);
  expect_error({"phantom", "--output", path("x"), "--depth", "deep"},
               "--depth: is 'deep', must be a number\n");
  expect_error({"slices", "--quiet=maybe"},
               "--quiet: is 'maybe', must be absent, since the option");
}

TEST_F(OptionErrors, AValueBeyondItsRangeOrListIsNamedWithWhatItMustBe) {
  expect_error({"register", "--threads", "0"}, "--threads: is '0', must be from 1 to 1024\n");
  expect_error({"convert", "a", "b", "--scan-convert", "wide"},
               "--scan-convert: is 'wide', must be from 0.05 to 20\n");
  expect_error({"register", "--probe-direction", "left", "down"},
               "--probe-direction: is 'down', must be one of left, right, anterior, posterior, ");
  expect_error({"convert", "a", "b", "--scan-convert", "1", "--normalise", "none"},
               "--normalise: is 'none', must be one of flattened, z-score\n");
}

TEST_F(OptionErrors, WhatIsMissingUnknownOrTooMuchIsNamed) {
  expect_error({}, "subcommand: is missing, must be one of info, convert, ");
  expect_error({"gold"}, "subcommand: is missing, must be one of fiducials, surfaces, ");
  expect_error({"convert", "case/ct.nrrd"}, "output: is missing, must be given (file to write)\n");
  expect_error({"register", "--ct", "a", "--us", "b"}, "--output: is missing, must be given\n");
  expect_error({"register", "--ct"}, "--ct: has no value, must have 1\n");
  expect_error({"slices", "--window", "3"}, "--window: has 1 value ('3'), must have 2\n");
  expect_error({"register", "--ct", "a", "--ct", "b", "--us", "c", "--output", "d"},
               "--ct: has 2 values ('a b'), must have 1\n");
  const std::vector<std::string> registration{"register", "--ct",     "a", "--us",
                                              "b",        "--output", "o"};
  const auto with = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = registration;
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  };
  expect_error(with({"--prset", "fast"}),
               "--prset: is no option of 'register', must be one that its --help lists, "
               "perhaps --preset\n");
  expect_error(with({"--quixotic=3"}),
               "--quixotic: is no option of 'register', must be one that its --help lists\n");
  expect_error(with({"fast"}), "'register': does not take the argument 'fast'");
  expect_error({"phantom", "--output", path("x"), "--labels", "l"}, "--labels requires --ct\n");
}

/// The core names its keys, which the command line does not have.
TEST_F(OptionErrors, AKeyOfTheCoreIsNamedWithItsOption) {
  expect_error({"phantom", "--output", path("x"), "--depth", "-5"},
               "phantom options: 'depth_mm' (--depth) is -5, must be ");
  expect_error({"phantom", "--output", path("x"), "--size", "3", "128", "81"},
               "phantom options: 'samples' (--size) is 3, must be ");
  std::vector<Eigen::Vector3d> helix;
  for (int i = 0; i < 40; ++i) helix.emplace_back(20 * std::cos(i), 30 * std::sin(i), 2 * i);
  write_points_mm(helix, path("points.csv"));
  expect_error({"gold", "icp", path("points.csv"), path("points.csv"), "--iterations", "0"},
               "ICP options: 'largest_iterations' (--iterations) is 0, must be ");
  write_ct({0, 70, 0});
  expect_error({"gold", "balls", path("ct.nrrd"), "--diameter", "0"},
               "ball options: 'diameter_mm' (--diameter) is 0, must be ");
}

TEST_F(OptionErrors, AnErrorOfASeriesNamesTheOption) {
  const auto tilted = data_root() / "dicom_gantry_tilt" / "gantry_tilt_GE_uneven";
  USCT_REQUIRE_DATA(tilted);
  const Outcome irregular = run_usct({"convert", tilted.string(), path("ct.nrrd"), "--quiet"});
  expect_part(irregular, "'resample_irregular' (--resample-irregular) interpolates");
  const Outcome other =
      run_usct({"convert", tilted.string(), path("ct.nrrd"), "--series", "1.2.3", "--quiet"});
  expect_part(other, "'series_uid' (--series) is '1.2.3', must be one of CT among");
}

/// A key of a file may be called like an option.
TEST_F(OptionErrors, AKeyOfAFileIsNotTakenForAnOption) {
  std::ofstream(path("options.yaml")) << "preset: patient\nseed: many\n";
  const Outcome file = run_usct({"register", "--ct", "c", "--us", "u", "--options",
                                 path("options.yaml"), "--output", path("o.json")});
  expect_part(file, "'seed'");
  EXPECT_EQ(file.errors.find("--seed"), std::string::npos) << file.errors;
}

TEST_F(OptionErrors, SlicesWithoutTheCtAreRefusedOrWarnedOf) {
  write_us();
  const auto slices = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{
        "slices",   "--us",        path("us.nrrd"), "--ct", path("ct.nrrd"),
        "--output", path("s.png"), "--pixel",       "2",    "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_usct(arguments);
  };
  write_ct({0, 70, 0});
  EXPECT_EQ(slices({}).errors, "");
  const Outcome beside = slices({"--at", "0", "100", "0"});
  EXPECT_EQ(beside.exit_status, 0);
  expect_part(beside, "ct.nrrd: does not lie in the planes lateral / elevation without ");
  std::filesystem::remove(path("s.png"));
  write_ct({0, -300, 500});
  const Outcome identity = slices({});
  EXPECT_EQ(identity.exit_status, 2);
  expect_part(identity, "lies in none of the planes to draw without --transform or --result");
  write_T_us_ct(Eigen::Isometry3d(Eigen::Translation3d(0, 370, 500)), path("wrong.tfm"));
  const Outcome wrong = slices({"--transform", path("wrong.tfm")});
  EXPECT_EQ(wrong.exit_status, 2);
  expect_part(wrong, "lies in none of the planes to draw by '" + path("wrong.tfm") + "'");
  EXPECT_FALSE(std::filesystem::exists(path("s.png")));
  write_T_us_ct(Eigen::Isometry3d(Eigen::Translation3d(0, 370, -500)), path("right.tfm"));
  EXPECT_EQ(slices({"--transform", path("right.tfm")}).errors, "");
}

TEST_F(OptionErrors, InfoGoesOnAfterAFileThatItCannotRead) {
  write_ct({0, 0, 0});
  std::ofstream(path("phantom.json")) << R"({"version": "1", "scene": "agar", "truth": {}})";
  const Outcome outcome =
      run_usct({"info", path("phantom.json"), path("absent.nrrd"), path("ct.nrrd")});
  EXPECT_EQ(outcome.exit_status, 2);
  expect_part(outcome, path("phantom.json") + ": is no result of a registration: key 'status'");
  expect_part(outcome, path("absent.nrrd") + ": does not exist");
  EXPECT_NE(outcome.output.find("ct.nrrd"), std::string::npos) << outcome.output;
  const Outcome json = run_usct({"info", "--json", path("phantom.json"), path("ct.nrrd")});
  EXPECT_EQ(json.exit_status, 2);
  EXPECT_EQ(json.output.front(), '[') << "several files are a list, however many can be read";
}

TEST_F(OptionErrors, ACtInPlaceOfUltrasoundIsRecognisedByItsValues) {
  write_ct({0, 70, 0});
  expect_error({"slices", "--us", path("ct.nrrd"), "--ct", path("ct.nrrd"), "--output",
                path("s.png"), "--quiet"},
               path("ct.nrrd") +
                   ": voxel values range from -1024 to 100, must lie from 0 to 255 "
                   "(uint8 is asked for); they look like the HU of a CT: are two "
                   "files exchanged?\n");
}

}  // namespace
}  // namespace usct::test
