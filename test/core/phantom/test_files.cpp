#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "core/io/expect_input_error.h"
#include "core/tools/run_usct.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/phantom/phantom_files.h"

namespace usct::phantom::test {
namespace {

namespace fs = std::filesystem;
using usct::test::TemporaryFolder;

PhantomOptions tiny_case() {
  PhantomOptions options;
  options.seed = 6;
  options.ct.size = {12, 10, 8};
  options.ct.spacing_mm = {8.0, 8.0, 8.0};
  options.sweep.samples = 40;
  options.sweep.lines = 8;
  options.sweep.frames = 3;
  options.sweep.lateral_fov_deg = 10.0;
  options.sweep.elevation_fov_deg = 4.0;
  return options;
}

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename());
  return names;
}

TEST(PhantomFiles, ComeBackAsTheyWere) {
  const TemporaryFolder folder;
  const PhantomCase phantom = make_phantom(tiny_case());
  const fs::path target = folder.path() / "case";
  write_phantom(phantom, target, ".nrrd");
  const CtVolume ct = read_volume<std::int16_t>(target / "ct.nrrd");
  EXPECT_EQ(ct.voxels, phantom.ct.voxels);
  EXPECT_TRUE(same_grid(ct.grid, phantom.ct.grid));
  EXPECT_EQ(read_volume<std::uint16_t>(target / "labels.nrrd").voxels, phantom.labels.voxels);
  EXPECT_EQ(read_prescan_nrrd(target / "us.nrrd").voxels, phantom.ultrasound.voxels);
  EXPECT_TRUE(read_T_us_ct(target / "truth.tfm").isApprox(phantom.truth.T_us_ct, 1e-9));
  EXPECT_EQ(read_points_mm(target / "targets.csv"), phantom.truth.targets_us_mm);
  EXPECT_EQ(read_points_mm(target / "fiducials_ct.csv"), phantom.truth.fiducials_ct_mm);
  EXPECT_EQ(names_in(folder.path()), std::set<std::string>{"case"});
}

TEST(PhantomFiles, AreAllThereOrNot) {
  const TemporaryFolder folder;
  PhantomCase phantom = make_phantom(tiny_case());
  phantom.truth.targets_us_mm.clear();  // cannot be written
  EXPECT_THROW(write_phantom(phantom, folder.path() / "case", ".nrrd"), InputError);
  EXPECT_TRUE(names_in(folder.path()).empty());
}

TEST(PhantomFiles, NeverReplaceWhatIsThere) {
  const TemporaryFolder folder;
  const fs::path used = folder.path() / "used";
  fs::create_directory(used);
  std::ofstream(used / "notes.txt") << "mine";
  usct::test::expect_input_error([&] { require_phantom_folder(used, ".nrrd"); },
                                 {"used", "empty folder"});
  usct::test::expect_input_error(
      [&] { require_phantom_folder(folder.path() / "absent" / "case", ".nrrd"); },
      {"does not exist"});
  usct::test::expect_input_error([&] { require_phantom_folder(folder.path() / "a", ".png"); },
                                 {".png", ".nii.gz"});
  fs::create_directory(folder.path() / "empty");
  EXPECT_NO_THROW(require_phantom_folder(folder.path() / "empty/", ".mha"));
}

const std::vector<std::string> kTiny = {"--size",
                                        "40",
                                        "8",
                                        "3",
                                        "--lateral-fov",
                                        "10",
                                        "--elevation-fov",
                                        "4",
                                        "--ct-size",
                                        "12",
                                        "10",
                                        "8",
                                        "--ct-spacing",
                                        "8",
                                        "8",
                                        "8",
                                        "--quiet"};

usct::test::Outcome run_phantom(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "phantom");
  arguments.insert(arguments.end(), kTiny.begin(), kTiny.end());
  return usct::test::run_usct(arguments);
}

TEST(PhantomCommand, WritesTheSameCaseAgain) {
  const TemporaryFolder folder;
  for (const char* name : {"a", "b"}) {
    const auto outcome = run_phantom({"--seed", "6", "--output", (folder.path() / name).string(),
                                      "--ct-format", "nii.gz", "--ct-axes", "RAS"});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  }
  for (const char* name : {"us.nrrd", "targets.csv", "phantom.json", "truth.tfm"})
    EXPECT_EQ(usct::test::read_text(folder.path() / "a" / name),
              usct::test::read_text(folder.path() / "b" / name))
        << name;
  EXPECT_EQ(read_volume<std::int16_t>(folder.path() / "a" / "ct.nii.gz").voxels,
            read_volume<std::int16_t>(folder.path() / "b" / "ct.nii.gz").voxels);
}

TEST(PhantomCommand, KnobsWinOverThePresetWhateverTheirOrder) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "case";
  const auto outcome = run_phantom(
      {"--contrast", "0.7", "--sweep", "tracked-linear", "--hard", "--output", target.string()});
  // --elevation-fov of a tracked sweep is a contradiction.
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_NE(outcome.errors.find("elevation_fov_deg"), std::string::npos) << outcome.errors;
  const auto motorised = run_phantom({"--contrast", "0.7", "--hard", "--output", target.string()});
  ASSERT_EQ(motorised.exit_status, 0) << motorised.errors;
  const auto json = nlohmann::json::parse(usct::test::read_text(target / "phantom.json"));
  EXPECT_EQ(json["options"]["anatomy"]["contrast"], 0.7);
  EXPECT_EQ(json["options"]["anatomy"]["bubbles"], 15);
  EXPECT_EQ(json["options"]["sweep"]["elevation_fov_deg"], 4.0);
}

TEST(PhantomCommand, RefusesBeforeItWorks) {
  const TemporaryFolder folder;
  const std::string target = (folder.path() / "case").string();
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--output", target, "--scene", "pig"}, "pig"},
      {{"--output", target, "--contrast", "7"}, "contrast"},
      {{"--output", target, "--scene", "from-ct"}, "--ct"},
      {{"--output", target, "--ct", "x.nrrd"}, "--ct"},
      {{"--output", target, "--label", "1=cortex"}, "--label requires --ct"},
      {{"--output", target, "--scene", "from-ct", "--ct", "x.nrrd", "--label", "kidney"},
       "LABEL=TISSUE"},
      {{"--output", target, "--ct-format", "jpg"}, "jpg"},
      {{"--output", (folder.path() / "no" / "where").string()}, "does not exist"},
      {{"--scene", "agar"}, "--output"}};
  for (const auto& [arguments, named] : cases) {
    const auto outcome = run_phantom(arguments);
    EXPECT_EQ(outcome.exit_status, 2);
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  }
  EXPECT_TRUE(names_in(folder.path()).empty());
}

/// A knob that changes nothing leaves a user with a case that is not what was asked for.
TEST(PhantomCommand, RefusesKnobsOfOtherScenesAndSweepsAndLabelsGivenTwice) {
  const TemporaryFolder folder;
  const std::string target = (folder.path() / "case").string();
  const std::vector<std::string> from_ct{"--scene", "from-ct", "--ct", "x.nrrd"};
  const auto refused = [&](std::vector<std::string> arguments, const std::vector<std::string>& more,
                           const std::string& named) {
    arguments.insert(arguments.begin(), {"phantom", "--output", target});
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto outcome = usct::test::run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 2) << named;
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  };
  refused({"--scene", "patient"}, {"--ball-diameter", "2"},
          "--ball-diameter: is given, must be left out unless --scene is agar");
  for (const char* lesion : {"--no-tumour", "--no-cyst", "--no-stone"}) {
    refused({"--scene", "agar"}, {lesion}, std::string(lesion) + ": is given");
    refused(from_ct, {lesion}, "unless --scene is patient");
  }
  refused(from_ct, {"--ct-size", "9", "9", "9"}, "--ct-size: is given");
  refused(from_ct, {"--ct-spacing", "1", "1", "1"}, "--ct-spacing: is given");
  refused(from_ct, {"--ct-noise", "5"}, "unless --scene is agar or patient");
  refused({"--frame-rate", "30"}, {}, "--frame-rate: is given");
  refused({"--sweep-length", "90"}, {}, "unless --sweep is tracked");
  refused({"--sweep", "tracked-linear"}, {"--lateral-fov", "40"}, "--lateral-fov: is given");
  refused(from_ct, {"--label", "1=cortex", "--label", "1=liver"}, "--label: names 1 twice");
  for (const char* seed : {"-1", "4294967296", "99999999999999999999999"})
    refused({"--seed", seed}, {}, "--seed");
  EXPECT_TRUE(names_in(folder.path()).empty());
}

TEST(PhantomCommand, TheEndoscopesCameraHasWhatRosReads) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "case";
  const auto outcome = run_phantom({"--scene", "patient", "--endoscope", "--endoscope-frames", "1",
                                    "--endoscope-size", "64", "64", "--output", target.string()});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  const YAML::Node camera = YAML::LoadFile((target / "endoscope" / "camera.yaml").string());
  const auto numbers = [&](const char* key) {
    return camera[key]["data"].as<std::vector<double>>();
  };
  const std::vector<double> K = numbers("camera_matrix");
  EXPECT_EQ(numbers("rectification_matrix"), (std::vector<double>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
  EXPECT_EQ(numbers("projection_matrix"),
            (std::vector<double>{K[0], 0, K[2], 0, 0, K[4], K[5], 0, 0, 0, 1, 0}));
}

}  // namespace
}  // namespace usct::phantom::test
