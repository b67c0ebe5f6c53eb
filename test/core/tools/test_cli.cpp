#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/io/example_volumes.h"
#include "core/tools/run_usct.h"
#include "test_data.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::test {
namespace {

/// A small motorised acquisition whose brightness is a smooth function of position.
double brightness(const Eigen::Vector3d& p_us) {
  return 120.0 + 60.0 * std::sin(0.1 * p_us.x()) + 40.0 * std::cos(0.08 * p_us.z() + 0.5) -
         0.5 * (p_us.y() - 70.0);
}

PreScanVolume smooth_acquisition() {
  PreScanVolume volume;
  volume.geometry.axial = {60, 5.0, 1.0};
  volume.geometry.array = CurvilinearArray{40.0, centred_table(48, 1.2 * kDegree)};
  volume.geometry.motion = MotorSweep{27.25, centred_table(40, 1.4634 * kDegree), 0.0};
  const BeamGrid beams = beam_grid(volume.geometry);
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l)
      for (int s = 0; s < beams.samples(); ++s)
        volume.voxels.push_back(
            static_cast<std::uint8_t>(std::nearbyint(brightness(beams.point(f, l, s)))));
  return volume;
}

class Cli : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  /// Runs usct and expects it to succeed.
  std::string run(const std::vector<std::string>& arguments) const {
    const Outcome outcome = run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 0) << outcome.errors;
    return outcome.output;
  }

  /// Runs usct and expects it to refuse, naming `named`.
  void expect_refused(const std::vector<std::string>& arguments, const std::string& named) const {
    const Outcome outcome = run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 2) << outcome.errors;
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  }

  TemporaryFolder folder_;
};

TEST_F(Cli, HelpExplainsUnitsAndFramesAndSucceeds) {
  for (const char* command : {"info", "convert", "phantom", "slices", "surfaces", "simulate",
                              "calibrate-motor", "evaluate", "study", "register", "presets"}) {
    const std::string help = run({command, "--help"});
    EXPECT_NE(help.find("mm"), std::string::npos) << command;
  }
  EXPECT_NE(run({"convert", "--help"}).find("US frame (x lateral"), std::string::npos);
  EXPECT_NE(run({"convert", "--help"}).find("[needed: Propello volumes"), std::string::npos);
}

TEST_F(Cli, BadArgumentsEndWithStatusTwo) {
  expect_refused({}, "subcommand: is missing");
  expect_refused({"registre"}, "subcommand: is 'registre', must be one of info, convert");
  expect_refused({"gold", "ball"}, "subcommand: is 'ball', must be one of fiducials");
  expect_refused({"info"}, "path");
  expect_refused({"info", path("absent.nrrd")}, path("absent.nrrd") + ": does not exist");
  expect_refused({"convert", path("absent.nrrd"), path("out.nrrd"), "--scan-convert", "0"}, "0.05");
}

TEST_F(Cli, InfoOfAnAcquisitionIsWhatWasWritten) {
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  const auto json = nlohmann::json::parse(run({"info", "--json", path("us.nrrd")}));
  EXPECT_EQ(json["geometry"], "motorised curvilinear");
  EXPECT_EQ(json["samples_lines_frames"], (nlohmann::json{60, 48, 40}));
  EXPECT_EQ(json["probe_radius_mm"], 40.0);
  EXPECT_EQ(json["depth_mm"], (nlohmann::json{5.0, 64.0}));
  EXPECT_NEAR(json["line_angles_deg"][0].get<double>(), -28.2, 1e-9);
  EXPECT_NEAR(json["frame_angles_deg_steps"][1].get<double>(), 1.4634, 1e-9);
  EXPECT_TRUE(json["warnings"].empty()) << json["warnings"];
}

TEST_F(Cli, InfoOfASixteenBitSequenceHasItsRange) {
  IgsioSequence sequence;
  sequence.width = 2;
  sequence.height = 2;
  sequence.element = IgsioElement::kInt16;
  sequence.orientation = "FM";
  sequence.image_type = "RF_REAL";
  sequence.frames.resize(1);
  for (const int value : {-300, 5, 1000, 0}) {
    const auto bits = static_cast<std::uint16_t>(value);
    sequence.data.push_back(static_cast<std::uint8_t>(bits & 0xff));
    sequence.data.push_back(static_cast<std::uint8_t>(bits >> 8));
  }
  write_igsio(sequence, path("rf.igs.mha"), false);
  const auto json = nlohmann::json::parse(run({"info", "--json", path("rf.igs.mha")}));
  EXPECT_EQ(json["range"], (nlohmann::json{-300, 1000}));
}

TEST_F(Cli, InfoOfADicomSeriesHasARangeOnlyIfItCanBeReadAsAVolume) {
  const auto regular = data_root() / "totalseg_ct" / "example_ct_dicom";
  const auto tilted = data_root() / "dicom_gantry_tilt";
  USCT_REQUIRE_DATA(regular);
  USCT_REQUIRE_DATA(tilted);
  const auto series_of = [&](const std::filesystem::path& folder) {
    return nlohmann::json::parse(run({"info", "--json", folder.string()}))["series"][0];
  };
  const auto good = series_of(regular);
  EXPECT_TRUE(good["problems"].empty());
  EXPECT_EQ(good["range"][0], -1024);  // air, as scanners store it
  EXPECT_GT(good["range"][1], 700);    // cortical bone
  const auto bad = series_of(tilted);
  EXPECT_EQ(bad["problems"].size(), 2U);
  EXPECT_FALSE(bad.contains("range"));
}

TEST_F(Cli, InfoWarnsOfRepeatedFramesAndSaturation) {
  PreScanVolume volume = smooth_acquisition();
  const std::size_t frame = volume.offset(0, 0, 1);
  for (std::size_t i = 0; i < frame; ++i) {
    volume.voxels[3 * frame + i] = volume.voxels[2 * frame + i];
    volume.voxels[10 * frame + i] = 255;
    volume.voxels[20 * frame + i] = 255;
  }
  write_prescan_nrrd(volume, path("us.nrrd"));
  const auto json = nlohmann::json::parse(run({"info", "--json", path("us.nrrd")}));
  EXPECT_EQ(json["warnings"],
            (nlohmann::json{"5 % of the samples are saturated (255)",
                            "1 of 40 frames repeat the image of the frame before"}));
}

TEST_F(Cli, InfoWarnsOfHolesBetweenTrackedFrames) {
  // 10 samples from 0 to 90 mm: the middle is 45 mm deep, and moves by 45 mm times the turn, rad.
  const auto described = [&](double turn) {
    PreScanVolume volume{{{10, 0.0, 10.0}, LinearArray{{-1.0, 0.0, 1.0}}, TrackedSweep()}, {}, {}};
    auto& frames = std::get<TrackedSweep>(volume.geometry.motion).T_us_frame;
    for (const double angle : {0.0, 0.05, 0.05 + turn, 0.1 + turn})
      frames.emplace_back(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()));
    for (std::size_t i = 0; i < 10 * 3 * 4; ++i)
      volume.voxels.push_back(static_cast<std::uint8_t>(i));
    write_prescan_nrrd(volume, path("tracked.nrrd"));
    return nlohmann::json::parse(run({"info", "--json", path("tracked.nrrd")}));
  };
  const auto whole = described(0.1);
  EXPECT_NEAR(whole["largest_step_of_the_middle_mm"], 45.0 * 2.0 * std::sin(0.05), 1e-6);
  EXPECT_TRUE(whole["warnings"].empty());
  const auto torn = described(0.2);
  EXPECT_NEAR(torn["largest_step_of_the_middle_mm"], 45.0 * 2.0 * std::sin(0.1), 1e-6);
  ASSERT_EQ(torn["warnings"].size(), 1U);
  const auto warning = torn["warnings"][0].get<std::string>();
  EXPECT_NE(warning.find("more than 5 mm apart"), std::string::npos) << warning;
}

TEST_F(Cli, ScanConversionAndItsInverseKeepWhatIsWhere) {
  const PreScanVolume original = smooth_acquisition();
  write_prescan_nrrd(original, path("us.nrrd"));
  run({"convert", path("us.nrrd"), path("space.nrrd"), "--scan-convert", "0.7", "--mask",
       path("mask.nrrd"), "--quiet"});
  const auto space = read_volume<std::uint8_t>(path("space.nrrd"));
  const auto mask = read_volume<std::uint8_t>(path("mask.nrrd"));
  ASSERT_TRUE(same_grid(space.grid, mask.grid));
  int known = 0;
  for (int k = 0; k < space.grid.size.z(); ++k)
    for (int j = 0; j < space.grid.size.y(); ++j)
      for (int i = 0; i < space.grid.size.x(); ++i) {
        if (mask.at(i, j, k) == 0) continue;
        ++known;
        // Interpolation between samples up to 2.7 mm apart, and the repeated edge of half a frame.
        EXPECT_NEAR(space.at(i, j, k),
                    brightness(space.grid.physical_from_index(Eigen::Vector3d(i, j, k))), 6.0);
      }
  EXPECT_GT(known, 100000);

  run({"convert", path("space.nrrd"), path("back.nrrd"), "--along-beams", path("us.nrrd"),
       "--window", "0", "255", "--quiet"});
  const PreScanVolume back = read_prescan_nrrd(path("back.nrrd"));
  for (int f = 2; f < 38; ++f)
    for (int l = 2; l < 46; ++l)
      for (int s = 2; s < 58; ++s) EXPECT_NEAR(back.at(s, l, f), original.at(s, l, f), 3);

  write_T_us_ct(Eigen::Isometry3d(Eigen::Translation3d(1000, 0, 0)), path("far.tfm"));
  expect_refused({"convert", path("space.nrrd"), path("far.nrrd"), "--along-beams", path("us.nrrd"),
                  "--window", "0", "255", "--transform", path("far.tfm")},
                 "meets it by '" + path("far.tfm"));
  EXPECT_FALSE(std::filesystem::exists(path("far.nrrd")));
}

TEST_F(Cli, NormalisedUltrasoundDoesNotDependOnGainOrBackground) {
  const PreScanVolume original = smooth_acquisition();
  PreScanVolume brighter = original;  // 20 more, and half the gain
  for (std::uint8_t& voxel : brighter.voxels) voxel = static_cast<std::uint8_t>(voxel / 2 + 20);
  write_prescan_nrrd(original, path("us.nrrd"));
  write_prescan_nrrd(brighter, path("brighter.nrrd"));
  for (const char* how : {"flattened", "z-score"}) {
    run({"convert", path("us.nrrd"), path("a.nrrd"), "--scan-convert", "1.5", "--mask",
         path("mask.nrrd"), "--normalise", how, "--smoothing", "0", "--quiet"});
    run({"convert", path("brighter.nrrd"), path("b.nrrd"), "--scan-convert", "1.5", "--normalise",
         how, "--smoothing", "0", "--quiet"});
    const auto a = read_volume<float>(path("a.nrrd"));
    const auto b = read_volume<float>(path("b.nrrd"));
    const auto mask = read_volume<std::uint8_t>(path("mask.nrrd"));
    double count = 0.0;
    double sum = 0.0;
    double squares = 0.0;
    for (std::size_t i = 0; i < a.voxels.size(); ++i) {
      if (mask.voxels[i] == 0) {
        ASSERT_EQ(a.voxels[i], 0.0F) << "beside the fan";
        continue;
      }
      ASSERT_NEAR(a.voxels[i], b.voxels[i], 0.2) << how;
      ++count;
      sum += a.voxels[i];
      squares += a.voxels[i] * a.voxels[i];
    }
    EXPECT_NEAR(sum / count, 0.0, 0.1) << how;
    EXPECT_GT(squares / count, 0.01) << how;
  }
  expect_refused({"convert", path("us.nrrd"), path("x.nrrd"), "--normalise", "z-score"},
                 "--scan-convert");
  expect_refused({"convert", path("us.nrrd"), path("x.nrrd"), "--scan-convert", "1.5",
                  "--normalise", "z-score", "--normalisation-window", "0"},
                 "window_mm");
}

TEST_F(Cli, VolumesKeepTheirVoxelsInSpaceThroughEveryFormat) {
  Grid grid;
  grid.size = {5, 6, 7};
  grid.spacing_mm = {0.5, 0.75, 2.0};
  grid.origin_mm = {-12.5, 33.25, 700.0};
  grid.direction = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 1, 0).normalized()).matrix();
  grid.direction.col(0).swap(grid.direction.col(2));
  CtVolume ct(grid);
  for (std::size_t i = 0; i < ct.voxels.size(); ++i)
    ct.voxels[i] = static_cast<std::int16_t>(7 * static_cast<int>(i) - 900);
  write_volume(ct, path("a.nrrd"));
  run({"convert", path("a.nrrd"), path("b.mha")});
  run({"convert", path("b.mha"), path("c.mhd")});
  run({"convert", path("c.mhd"), path("d.nii.gz"), "--reorient"});
  run({"convert", path("d.nii.gz"), path("e.nrrd")});
  const CtVolume result = read_volume<std::int16_t>(path("e.nrrd"));
  for (int k = 0; k < 7; ++k)
    for (int j = 0; j < 6; ++j)
      for (int i = 0; i < 5; ++i)
        EXPECT_EQ(sample(result, grid.physical_from_index(Eigen::Vector3d(i, j, k)),
                         Interpolation::kNearest, Outside::constant(-9999)),
                  ct.at(i, j, k));
}

/// An option that is passed over in silence leaves a user with a file that is not what was asked
/// for.
TEST_F(Cli, ConvertRefusesOptionsForOtherContent) {
  CtVolume ct(test::example_grids().front().grid);
  write_volume(ct, path("ct.nrrd"));
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  const auto refused = [&](const char* input, std::vector<std::string> options,
                           const std::string& named) {
    options.insert(options.begin(), {"convert", path(input), path("out.nrrd")});
    expect_refused(options, named);
    EXPECT_FALSE(std::filesystem::exists(path("out.nrrd")));
  };
  refused("ct.nrrd", {"--transform", "a.tfm"}, "--along-beams");
  refused("ct.nrrd", {"--window", "0", "100"}, "--along-beams");
  refused("ct.nrrd", {"--reorient", "--along-beams", path("us.nrrd"), "--window", "0", "9"},
          "--reorient");
  refused("ct.nrrd", {"--series", "1.2"}, "DICOM");
  refused("ct.nrrd", {"--scan-convert", "2"}, "'--scan-convert' is for ultrasound");
  refused("us.nrrd", {"--reorient"}, "'--reorient' is for volumes");
  refused("us.nrrd", {"--along-beams", path("us.nrrd")}, "'--along-beams' is for volumes");
}

TEST_F(Cli, NumbersThatAreNotFiniteAreRefused) {
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  expect_refused({"convert", path("us.nrrd"), path("out.nrrd"), "--scan-convert", "nan"},
                 "--scan-convert: is 'nan', must be finite");
  EXPECT_FALSE(std::filesystem::exists(path("out.nrrd")));
}

/// Options of compounding are for tracked frames of which a volume is made.
TEST_F(Cli, OptionsOfCompoundingWithoutUseAreRefused) {
  write_volume(CtVolume(test::example_grids().front().grid), path("ct.nrrd"));
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  const std::string left_out = "--hole-fill: is given, must be left out unless ";
  const auto refused = [&](std::vector<std::string> arguments, const std::string& condition) {
    arguments.insert(arguments.end(), {"--hole-fill", "2", "--quiet"});
    expect_refused(arguments, left_out + condition);
    EXPECT_FALSE(std::filesystem::exists(path("out.nrrd")));
  };
  const std::string us = path("us.nrrd");
  refused({"convert", us, path("out.nrrd")}, "--scan-convert is given");
  refused({"convert", path("ct.nrrd"), path("out.nrrd")}, "--scan-convert is given");
  refused({"convert", us, path("out.nrrd"), "--scan-convert", "2"},
          "the ultrasound has tracked frames");
  refused({"slices", "--us", us, "--ct", path("ct.nrrd"), "--output", path("out.png")},
          "the ultrasound has tracked frames");
  refused({"simulate", "--us", us, "--ct", path("ct.nrrd"), "--output", path("out")},
          "--parallel-beams is given");
  const std::vector<std::string> registration{"register", "--us",          us,
                                              "--ct",     path("ct.nrrd"), "--preset",
                                              "global",   "--output",      path("out.json")};
  refused(registration, "--pictures or --parallel-beams is given");
  // Subcommands that make no volume do not have them.
  expect_refused({"lag", us, "--hole-fill", "2"}, "--hole-fill");
}

/// The first of two files must not be written if the second cannot be.
TEST_F(Cli, AMaskThatCannotBeWrittenIsRefusedFirst) {
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  for (const char* mask : {"mask.foo", "mask.nhdr", "absent/mask.nrrd"}) {
    expect_refused({"convert", path("us.nrrd"), path("out.nrrd"), "--scan-convert", "2", "--mask",
                    path(mask), "--quiet"},
                   "--mask: is '" + path(mask));
    EXPECT_FALSE(std::filesystem::exists(path("out.nrrd")));
  }
}

TEST_F(Cli, AWindowMustRise) {
  write_volume(CtVolume(test::example_grids().front().grid), path("ct.nrrd"));
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  const std::vector<std::string> images{"--us", path("us.nrrd"), "--ct", path("ct.nrrd")};
  for (const char* command : {"slices", "simulate"})
    for (const auto& [low, high, named] :
         {std::tuple("340", "-160", "--window: is 340 to -160, must rise"),
          std::tuple("100", "100", "--window: is 100 to 100, must rise")}) {
      std::vector<std::string> arguments{command};
      arguments.insert(arguments.end(), images.begin(), images.end());
      arguments.insert(arguments.end(), {"--output", path("out.png"), "--window", low, high});
      expect_refused(arguments, named);
      EXPECT_FALSE(std::filesystem::exists(path("out.png")));
    }
  expect_refused({"convert", path("ct.nrrd"), path("out.nrrd"), "--along-beams", path("us.nrrd"),
                  "--window", "9", "0"},
                 "--window: is 9 to 0, must rise");
}

/// The ranges of CLI11 would print the largest double in full.
TEST_F(Cli, ANumberOutOfRangeIsRefusedInAFewWords) {
  const std::vector<std::string> simulation{"simulate", "--ct",     "ct.nrrd",  "--us",
                                            "us.nrrd",  "--output", path("out")};
  const auto refused = [&](std::vector<std::string> arguments, const std::string& named) {
    const Outcome outcome = run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 2) << named;
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
    EXPECT_LT(outcome.errors.size(), 200U) << outcome.errors;
  };
  std::vector<std::string> frame = simulation;
  frame.insert(frame.end(), {"--frame", "-1"});
  refused(frame, "--frame: is -1, must be >= 0");
  refused({"study", "case", "--box-mm", "-1"}, "--box-mm: is -1, must be >= 0");
  refused({"study", "case", "--box-deg", "400"}, "--box-deg: is '400', must be from 0 to 180");
  refused({"study", "case", "--parallel-beams", "0"}, "--parallel-beams");
  refused({"study", "case", "--threads", "0"}, "--threads: is '0', must be from 1 to 1024");
  refused({"overlay", "--labels", "l.nrrd", "--camera", "c.yaml", "--pose", "p.tfm", "--output",
           path("out.png"), "--triangles", "5"},
          "--triangles: is '5', must be from 1000 to 2000000");
  refused({"presets", "--complete"}, "--complete requires name");
}

TEST_F(Cli, UltrasoundAlongTheBeamsIsWrittenInTheFormatOfItsEnding) {
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  run({"convert", path("us.nrrd"), path("a.nrrd"), "--scan-convert", "2", "--quiet"});
  expect_refused({"convert", path("a.nrrd"), path("out.mha"), "--along-beams", path("us.nrrd"),
                  "--window", "0", "100"},
                 "out.mha");
  EXPECT_FALSE(std::filesystem::exists(path("out.mha")));
}

TEST_F(Cli, OptionsOfWhatIsNotAskedForAreRefused) {
  const std::vector<std::string> phantom{"phantom", "--output", path("case")};
  for (const auto& [option, needed] :
       {std::pair("--labels", "--ct"), std::pair("--endoscope-frames", "--endoscope")}) {
    std::vector<std::string> arguments = phantom;
    arguments.insert(arguments.end(), {option, "3"});
    expect_refused(arguments, std::string(option) + " requires " + needed);
  }
  EXPECT_FALSE(std::filesystem::exists(path("case")));
}

TEST_F(Cli, OptionsWithoutEffectAreRefused) {
  const std::vector<std::string> simulate{"simulate",      "--ct",     path("ct.nrrd"), "--us",
                                          path("us.nrrd"), "--output", path("out")};
  const auto with = [](std::vector<std::string> arguments, const std::vector<std::string>& more) {
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  };
  for (const char* option : {"--bone-hu", "--gas-hu", "--echo"})
    expect_refused(with(simulate, {option, "100"}), std::string(option) + " requires --occlusion");
  expect_refused(with(simulate, {"--log-compression", "intensity", "--reflection-scale", "3"}),
                 "--reflection-scale: is given, must be left out");
  expect_refused({"overlay", "--labels", "l", "--camera", "c", "--pose", "p", "--output", "o.png",
                  "--bound", "8"},
                 "--bound requires --band");
  expect_refused(
      {"register", "--ct", "c", "--us", "u", "--output", "o.json", "--targets", "t", "--json"},
      "--targets excludes --json");
  std::filesystem::create_directory(path("case"));
  expect_refused({"study", path("case"), "--profiles"}, "--profiles: is given without --output");
}

/// The folder of a case holds a ct.nrrd of its own.
TEST_F(Cli, SimulateMakesAFolderAndNeverWritesIntoOne) {
  write_volume(sampled(example_grids().front().grid), path("ct.nrrd"));
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  const std::string before = test::read_text(path("ct.nrrd"));
  expect_refused({"simulate", "--ct", path("ct.nrrd"), "--us", path("us.nrrd"), "--output",
                  folder_.path().string(), "--quiet"},
                 folder_.path().string());
  EXPECT_EQ(test::read_text(path("ct.nrrd")), before);
}

/// A file may store small whole numbers, with a slope and an intercept that make others of them.
TEST_F(Cli, ScaledVoxelsAreConvertedToATypeThatHoldsThem) {
  Volume<std::uint8_t> stored(test::example_grids().front().grid);
  for (std::size_t i = 0; i < stored.voxels.size(); ++i)
    stored.voxels[i] = static_cast<std::uint8_t>(i % 256);
  for (const auto& [slope, intercept] :
       {std::pair(16.0F, -1024.0F), std::pair(0.001F, 0.0F), std::pair(200.0F, 0.0F)}) {
    write_volume(stored, path("a.nii"));
    std::string bytes = test::read_text(path("a.nii"));
    std::memcpy(&bytes[112], &slope, 4);  // scl_slope and scl_inter of nifti1.h
    std::memcpy(&bytes[116], &intercept, 4);
    test::write_text(path("a.nii"), bytes);
    run({"convert", path("a.nii"), path("b.nrrd")});
    const auto converted = read_volume<float>(path("b.nrrd"));
    for (std::size_t i = 0; i < stored.voxels.size(); ++i)
      ASSERT_FLOAT_EQ(converted.voxels[i], slope * stored.voxels[i] + intercept);
  }
}

TEST_F(Cli, OutputThatCannotBeWrittenIsAFailure) {
  EXPECT_NE(std::system("'" USCT_TOOL "' presets > /dev/full 2> /dev/null"), 0);
}

/// A file that is written must be none that is read.
TEST_F(Cli, AnOutputThatIsAnInputIsRefused) {
  write_volume(sampled(example_grids().front().grid), path("a.nrrd"));
  const std::string before = test::read_text(path("a.nrrd"));
  std::filesystem::create_symlink(path("a.nrrd"), path("link.nrrd"));
  std::filesystem::create_directory(path("below"));
  const std::vector<std::string> registration{
      "register", "--ct", path("a.nrrd"), "--us", path("b.nrrd"), "--preset", "global", "--output"};
  for (const std::string& same : {path("a.nrrd"), path("link.nrrd"), path("below/../a.nrrd")}) {
    expect_refused({"convert", path("a.nrrd"), same},
                   "output: is '" + same + "', the file of input, must be another");
    std::vector<std::string> arguments = registration;
    arguments.push_back(same);
    expect_refused(arguments, "--output: is '" + same + "', the file of --ct, must be another");
    arguments.back() = path("result.json");
    arguments.insert(arguments.end(), {"--transform", same});
    expect_refused(arguments, "--transform: is '" + same + "', the file of --ct, must be another");
    EXPECT_EQ(test::read_text(path("a.nrrd")), before);
  }
}

TEST_F(Cli, ARecordingAndItsProbeGiveTheAcquisitionBack) {
  PreScanVolume volume = smooth_acquisition();
  volume.geometry.axial = {60, 0.0, 0.308};  // 1540 m/s at 2.5 MHz
  write_prescan_nrrd(volume, path("us.nrrd"));
  std::ofstream(path("probe.yaml")) << "name: test\nkind: motorised_curvilinear\n"
                                       "probe_radius_mm: 40\nmotor_radius_mm: 27.25\n"
                                       "lines: 48\nline_pitch_deg: 1.2\n"
                                       "motor_step_deg: 0.18292500001\nmotor_steps_per_frame: 8\n"
                                       "start_depth_mm: 0\nsample_spacing_mm: 0.308\n";
  for (const char* name : {"us.bpr", "us.vol"}) {
    run({"convert", path("us.nrrd"), path(name)});
    run({"convert", path(name), path("back.nrrd"), "--probe", path("probe.yaml")});
    const PreScanVolume back = read_prescan_nrrd(path("back.nrrd"));
    EXPECT_EQ(back.voxels, volume.voxels);
    const ScanIndex corner{59, 47, 39};
    EXPECT_LT((us_from_scan(back.geometry, corner) - us_from_scan(volume.geometry, corner)).norm(),
              1e-6);
  }
  // The way back: the formats have no place for its direction, and say how it is read.
  auto& sweep = std::get<MotorSweep>(volume.geometry.motion);
  std::reverse(sweep.frame_angles_rad.begin(), sweep.frame_angles_rad.end());
  sweep.frame_travel_rad = -sweep.frame_travel_rad;
  write_prescan_nrrd(volume, path("us.nrrd"));
  for (const char* name : {"us.bpr", "us.vol"}) {
    const test::Outcome written = test::run_usct({"convert", path("us.nrrd"), path(name)});
    EXPECT_NE(written.errors.find("--first-backward"), std::string::npos);
    run({"convert", path(name), path("back.nrrd"), "--probe", path("probe.yaml"),
         "--first-backward"});
    const PreScanVolume back = read_prescan_nrrd(path("back.nrrd"));
    const ScanIndex corner{59, 47, 39};
    EXPECT_LT((us_from_scan(back.geometry, corner) - us_from_scan(volume.geometry, corner)).norm(),
              1e-6);
  }
  expect_refused({"convert", path("us.bpr"), path("x.nrrd")}, "a probe YAML is needed");
  expect_refused({"convert", path("us.nrrd"), path("x.nrrd"), "--sweep", "3"}, "'sweep' is '3'");
  expect_refused({"convert", path("probe.yaml"), path("x.nrrd"), "--sweep", "3"}, "not ultrasound");
  EXPECT_FALSE(std::filesystem::exists(path("x.nrrd")));
}

TEST_F(Cli, ATrackedSweepSurvivesASequenceFile) {
  PreScanVolume volume;
  volume.geometry.axial = {40, 0.0, 0.5};
  volume.geometry.array = LinearArray{centred_table(16, 0.75)};
  TrackedSweep sweep;
  for (int f = 0; f < 5; ++f) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(0.1 * f, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
    T.translation() = Eigen::Vector3d(1.5 * f, 3, -2);
    sweep.T_us_frame.push_back(T);
    sweep.frame_times_s.push_back(10.0 + 0.04 * f);
  }
  volume.geometry.motion = sweep;
  for (int i = 0; i < 40 * 16 * 5; ++i) volume.voxels.push_back(static_cast<std::uint8_t>(i % 251));
  write_prescan_nrrd(volume, path("us.nrrd"));
  std::ofstream(path("probe.yaml")) << "name: test\nkind: linear\nlines: 16\nline_pitch_mm: 0.75\n"
                                       "start_depth_mm: 0\nsample_spacing_mm: 0.5\n";
  run({"convert", path("us.nrrd"), path("us.igs.mha")});
  run({"convert", path("us.igs.mha"), path("back.nrrd"), "--probe", path("probe.yaml")});
  const PreScanVolume back = read_prescan_nrrd(path("back.nrrd"));
  EXPECT_EQ(back.voxels, volume.voxels);
  const auto& poses = std::get<TrackedSweep>(back.geometry.motion);
  for (std::size_t f = 0; f < 5; ++f) {
    EXPECT_TRUE(poses.T_us_frame[f].isApprox(sweep.T_us_frame[f], 1e-9));
    EXPECT_NEAR(poses.frame_times_s[f], sweep.frame_times_s[f], 1e-9);
  }
}

TEST_F(Cli, OnlyARegisteredResultBecomesATransform) {
  RegistrationResult result;
  result.message = "no overlap";
  result.status = RegistrationStatus::kNoOverlap;
  write_result(result, path("refused.json"));
  expect_refused({"convert", path("refused.json"), path("out.tfm")}, "no_overlap");
  EXPECT_FALSE(std::filesystem::exists(path("out.tfm")));

  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  T_us_ct.linear() = Eigen::AngleAxisd(1.0, Eigen::Vector3d(3, -1, 2).normalized()).matrix();
  T_us_ct.translation() = Eigen::Vector3d(10, -20, 30);
  result.status = RegistrationStatus::kRegistered;
  result.T_us_ct = T_us_ct;
  write_result(result, path("good.json"));
  run({"convert", path("good.json"), path("out.tfm")});
  run({"convert", path("out.tfm"), path("out.h5")});
  EXPECT_TRUE(read_T_us_ct(path("out.h5")).isApprox(T_us_ct, 1e-12));
}

TEST_F(Cli, AFailedConversionLeavesTheOldFileAlone) {
  std::ofstream(path("target.nrrd")) << "precious";
  std::ofstream(path("broken.nrrd")) << "NRRD0004\ntype: short\ndimension: 3\nsizes: 9 9 9\n\n";
  expect_refused({"convert", path("broken.nrrd"), path("target.nrrd")}, "broken.nrrd");
  EXPECT_EQ(read_text(path("target.nrrd")), "precious");
  int files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    ++files;
  EXPECT_EQ(files, 2) << "a temporary file was left behind";
}

TEST_F(Cli, SlicesDrawsThreePlanesOfFourPictures) {
  write_prescan_nrrd(smooth_acquisition(), path("us.nrrd"));
  Grid grid;
  grid.size = {60, 60, 60};
  grid.origin_mm = {-30, 45, -30};
  write_volume(CtVolume(grid, 340), path("ct.nrrd"));
  write_points_mm({{0, 70, 0}, {1, 72, 0}}, path("points.csv"));
  run({"slices", "--us", path("us.nrrd"), "--ct", path("ct.nrrd"), "--points", path("points.csv"),
       "--output", path("sheet.png"), "--pixel", "1", "--quiet"});
  const cv::Mat sheet = cv::imread(path("sheet.png"));
  ASSERT_FALSE(sheet.empty());
  // The white CT takes its share of the second column, the red points are drawn.
  const cv::Mat second_column = sheet.colRange(sheet.cols / 4, sheet.cols / 2);
  int white = 0;
  int red = 0;
  for (int y = 0; y < sheet.rows; ++y) {
    for (int x = 0; x < second_column.cols; ++x)
      white += second_column.at<cv::Vec3b>(y, x) == cv::Vec3b(255, 255, 255) ? 1 : 0;
    for (int x = 0; x < sheet.cols; ++x)
      red += sheet.at<cv::Vec3b>(y, x) == cv::Vec3b(60, 60, 255) ? 1 : 0;
  }
  EXPECT_GT(white, 3 * 40 * 40);
  EXPECT_GT(red, 8);
}

}  // namespace
}  // namespace usct::test
