#include <gtest/gtest.h>

#include <fstream>

#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "test_paths.h"
#include "us_ct_registration/io/file_kind.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/ultrasound/propello.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

class DetectFileKind : public testing::Test {
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

TEST_F(DetectFileKind, ByContentWhereTheNameSaysNothing) {
  Grid grid;
  grid.size = {2, 2, 2};
  write_volume(CtVolume(grid), path("ct.nrrd"));
  write_prescan_nrrd(small_sweep(), path("us.nrrd"));
  EXPECT_EQ(detect_file_kind(path("ct.nrrd")), FileKind::kVolume);
  EXPECT_EQ(detect_file_kind(path("us.nrrd")), FileKind::kPreScan);
  EXPECT_EQ(detect_file_kind(folder_.path()), FileKind::kDicom);

  std::string dicom(132, '\0');
  dicom.replace(128, 4, "DICM");
  std::ofstream(path("IM000001"), std::ios::binary) << dicom;
  EXPECT_EQ(detect_file_kind(path("IM000001")), FileKind::kDicom);

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
  EXPECT_EQ(detect_file_kind(path("recording.dat")), FileKind::kUltrasonix);
}

TEST_F(DetectFileKind, NamesWhatIsNoFileOfOurs) {
  std::ofstream(path("empty.nrrd"));
  std::ofstream(path("notes.doc")) << "dear diary";
  expect_input_error([&] { detect_file_kind(path("absent")); }, {"absent", "does not exist"});
  expect_input_error([&] { detect_file_kind(path("empty.nrrd")); }, {"empty.nrrd", "is empty"});
  expect_input_error([&] { detect_file_kind(path("notes.doc")); }, {"notes.doc", "none of"});
}

TEST_F(DetectFileKind, ADamagedRecordingIsStillARecording) {
  std::ofstream(path("cut.vol")) << "cut off";
  EXPECT_EQ(detect_file_kind(path("cut.vol")), FileKind::kPropello);
  UltrasoundSource source;
  source.path = path("cut.vol");
  source.probe = USCT_SOURCE_DIR "/config/probes/4dc7-3_40.yaml";
  expect_input_error([&] { read_ultrasound(source); }, {"cut.vol"});
}

TEST_F(DetectFileKind, WhatIsNotUltrasoundIsNotReadAsUltrasound) {
  write_points_mm({{1, 2, 3}}, path("points.csv"));
  write_T_us_ct(Eigen::Isometry3d::Identity(), path("t.tfm"));
  UltrasoundSource source;
  for (const char* name : {"points.csv", "t.tfm"}) {
    source.path = path(name);
    expect_input_error([&] { read_ultrasound(source); }, {name, "not ultrasound"});
  }
}

TEST_F(DetectFileKind, AProbeForAFileThatHoldsItsOwnGeometryIsAContradiction) {
  write_prescan_nrrd(small_sweep(), path("us.nrrd"));
  UltrasoundSource source;
  source.path = path("us.nrrd");
  EXPECT_EQ(std::get<PreScanVolume>(read_ultrasound(source).data).voxels.size(), 6U);
  source.probe = "some_probe.yaml";
  expect_input_error([&] { read_ultrasound(source); },
                     {"some_probe.yaml", "holds its own geometry"});
}

}  // namespace
}  // namespace usct::test
