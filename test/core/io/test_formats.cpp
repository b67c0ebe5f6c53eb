#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "test_paths.h"
#include "us_ct_registration/io/formats.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/ultrasound/propello.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

class DetectFormat : public testing::Test {
 protected:
  std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }
  TemporaryFolder folder_;
};

PreScanVolume small_sweep() {
  PreScanVolume volume;
  volume.geometry.axial = {3, 0.0, 1.0};
  volume.geometry.array = LinearArray{{0.0, 1.0}};
  volume.geometry.motion = TrackedSweep{{Eigen::Isometry3d::Identity()}, {}};
  volume.voxels.resize(6);
  return volume;
}

/// Gives the option a value other than its default.
void give(const UltrasoundOption& option, UltrasoundSource& source) {
  struct Giver {
    UltrasoundSource& source;
    void operator()(std::filesystem::path UltrasoundSource::*field) const { source.*field = "x"; }
    void operator()(std::string UltrasoundSource::*field) const { source.*field = "x"; }
    void operator()(int UltrasoundSource::*field) const { source.*field = 7; }
    void operator()(bool UltrasoundSource::*field) const { source.*field = true; }
    void operator()(std::optional<Eigen::Vector2d> UltrasoundSource::*) const {
      source.image_origin_px = source.image_spacing_mm = Eigen::Vector2d(1.0, 2.0);
    }
  };
  std::visit(Giver{source}, option.field);
}

TEST_F(DetectFormat, ByContentWhereTheNameSaysNothing) {
  Grid grid;
  grid.size = {2, 2, 2};
  write_volume(CtVolume(grid), path("ct.nrrd"));
  write_prescan_nrrd(small_sweep(), path("us.nrrd"));
  EXPECT_EQ(detect_format(path("ct.nrrd")).name, "volume");
  EXPECT_EQ(detect_format(path("us.nrrd")).name, "pre-scan ultrasound (NRRD)");
  EXPECT_EQ(detect_format(folder_.path()).name, "DICOM series");

  std::string dicom(132, '\0');
  dicom.replace(128, 4, "DICM");
  std::ofstream(path("IM000001"), std::ios::binary) << dicom;
  EXPECT_EQ(detect_format(path("IM000001")).name, "DICOM series");

  UltrasonixSequence sequence;
  sequence.header.type = kUltrasonixPreScanB;
  sequence.header.frames = 1;
  sequence.header.w = 20;
  sequence.header.h = 30;
  sequence.header.ss = 8;
  sequence.header.sf = 2500000;
  sequence.voxels.resize(600);
  write_ultrasonix(sequence, path("a.bpr"));
  std::filesystem::copy(path("a.bpr"), path("recording.dat"));
  EXPECT_EQ(detect_format(path("recording.dat")).name, "Ultrasonix recording");
}

TEST_F(DetectFormat, NamesWhatIsNoFileOfOurs) {
  std::ofstream(path("empty.nrrd"));
  std::ofstream(path("notes.doc")) << "dear diary";
  expect_input_error([&] { detect_format(path("absent")); }, {"absent", "does not exist"});
  expect_input_error([&] { detect_format(path("empty.nrrd")); }, {"empty.nrrd", "is empty"});
  expect_input_error([&] { detect_format(path("notes.doc")); }, {"notes.doc", "none of"});
}

TEST_F(DetectFormat, ADamagedRecordingIsStillARecording) {
  std::ofstream(path("cut.vol")) << "cut off";
  EXPECT_EQ(detect_format(path("cut.vol")).name, "Propello volumes");
  UltrasoundSource source;
  source.path = path("cut.vol");
  source.probe = USCT_SOURCE_DIR "/config/probes/4dc7-3_40.yaml";
  expect_input_error([&] { read_ultrasound(source); }, {"cut.vol"});
}

TEST_F(DetectFormat, WhatIsNotUltrasoundIsNotReadAsUltrasound) {
  write_points_mm({{1, 2, 3}}, path("points.csv"));
  write_T_us_ct(Eigen::Isometry3d::Identity(), path("t.tfm"));
  UltrasoundSource source;
  for (const char* name : {"points.csv", "t.tfm"}) {
    source.path = path(name);
    expect_input_error([&] { read_ultrasound(source); }, {name, "not ultrasound"});
  }
}

TEST_F(DetectFormat, AProbeForAFileThatHoldsItsOwnGeometryIsAContradiction) {
  write_prescan_nrrd(small_sweep(), path("us.nrrd"));
  UltrasoundSource source;
  source.path = path("us.nrrd");
  EXPECT_EQ(std::get<PreScanVolume>(read_ultrasound(source).data).voxels.size(), 6U);
  source.probe = "some_probe.yaml";
  expect_input_error([&] { read_ultrasound(source); },
                     {"some_probe.yaml", "holds its own geometry"});
}

TEST_F(DetectFormat, EveryRowIsCompleteAndFoundByItsEndings) {
  std::set<std::string> names;
  for (const FileFormat& format : file_formats()) {
    EXPECT_TRUE(names.insert(format.name).second) << format.name << " is there twice";
    EXPECT_TRUE(!format.endings.empty() || format.recognises != nullptr) << format.name;
    EXPECT_NE(format.describe, nullptr) << format.name;
    EXPECT_FALSE(format.recognises != nullptr && format.recognises(path("absent"))) << format.name;
    EXPECT_TRUE(format.ultrasound || format.content != FileContent::kUltrasound) << format.name;
    if (!format.ultrasound) continue;
    EXPECT_NE(format.ultrasound->read, nullptr) << format.name;
    EXPECT_EQ(format.ultrasound->write == nullptr, format.ultrasound->written_ending.empty());
  }
  for (const FileFormat& format : file_formats())
    for (const std::string& ending : format.endings) {
      std::ofstream(path("a" + ending)) << "x";
      EXPECT_EQ(detect_format(path("a" + ending)).name, format.name) << ending;
    }
}

/// Each option that a format cannot use is given with a file of the format.
TEST_F(DetectFormat, OptionsThatAFormatCannotUseAreRefused) {
  PreScanVolume motorised = small_sweep();
  motorised.geometry.array = CurvilinearArray{40.0, {-0.1, 0.1}};
  motorised.geometry.motion = MotorSweep{27.0, {-0.01, 0.01}, 0.0};
  motorised.voxels.resize(12);
  for (const FileFormat& format : file_formats()) {
    if (!format.ultrasound || format.ultrasound->write == nullptr) continue;
    const auto file = path("sweep" + format.ultrasound->written_ending);
    const bool tracked = format.ultrasound->can_use(&UltrasoundSource::calibration);
    format.ultrasound->write(tracked ? small_sweep() : motorised, file);
    ASSERT_EQ(detect_format(file).name, format.name);
    int refused = 0;
    for (const UltrasoundOption& option : ultrasound_options()) {
      if (format.ultrasound->can_use(option.field)) continue;
      UltrasoundSource source;
      source.path = file;
      source.probe = format.ultrasound->needs(&UltrasoundSource::probe) ? "probe.yaml" : "";
      give(option, source);
      // The two options for the probe's place in the image are given together, and the first is
      // named.
      const std::string name = option.name;
      const std::string named = name == "image_spacing_mm" ? "image_origin_px" : name;
      expect_input_error([&] { read_ultrasound(source); },
                         {file.string(), "'" + named + "' is '", format.name, "cannot use it",
                          format.ultrasound->refusal});
      ++refused;
    }
    EXPECT_GT(refused, 0) << format.name;
  }
}

TEST_F(DetectFormat, AnOptionThatAFormatNeedsIsNamed) {
  for (const char* name : {"a.vol", "a.bpr"}) {
    std::ofstream(path(name)) << "x";
    UltrasoundSource source;
    source.path = path(name);
    expect_input_error([&] { read_ultrasound(source); }, {name, "'probe'", "is needed"});
  }
}

TEST_F(DetectFormat, ThePlaceInTheImageTakesBothOfItsOptions) {
  UltrasoundSource source;
  source.image_origin_px = Eigen::Vector2d(1.0, 2.0);
  expect_input_error([&] { source.validate(); }, {"'image_spacing_mm'", "together"});
  source.image_spacing_mm = Eigen::Vector2d(0.5, 0.5);
  EXPECT_NO_THROW(source.validate());
}

}  // namespace
}  // namespace usct::test
