#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/io/dicom_patient.h"
#include "core/io/dicom_writer.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/temporary_folder.h"
#include "core/io/without_permission.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/formats.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "with_threads.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using test::DicomSlice;
using test::expect_input_error;
using test::expect_shows_the_patient;
using test::kRounding;
using test::small_grid;
using test::TemporaryFolder;

/// A folder as on a hospital's disc: studies in subfolders, and other files beside the images.
class DicomDisc : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_.path() / "study" / "ct");
    fs::create_directories(folder_.path() / "study" / "mr");
    test::write_shuffled(ct(), test::slices_of(small_grid()));
    DicomSlice mr;
    mr.modality = "MR";
    mr.sop_class = "1.2.840.10008.5.1.4.1.1.4";
    mr.series_uid += ".7";
    test::write_dicom(folder_.path() / "study" / "mr" / "IM1", mr);
    std::ofstream(folder_.path() / "README.TXT") << "viewer on this disc";
    std::ofstream(ct() / "._slice_0.dcm") << "not DICOM, from another system";
    std::ofstream(ct() / ".DS_Store") << "x";
  }
  fs::path ct() const { return folder_.path() / "study" / "ct"; }
  void add_second_ct(const std::string& series_uid = "1.2.826.0.1.3680043.2.1.2") {
    std::vector<DicomSlice> slices = test::slices_of(small_grid());
    fs::create_directories(folder_.path() / "study" / "ct2");
    for (DicomSlice& slice : slices) {
      slice.series_uid = series_uid;
      slice.series_number = 2;
      slice.hounsfield = [](const Eigen::Vector3d&) { return 77.0; };
    }
    test::write_shuffled(folder_.path() / "study" / "ct2", slices);
  }
  static bool warned(const LoadedCt& ct, const std::string& what) {
    for (const std::string& warning : ct.warnings)
      if (warning.find(what) != std::string::npos) return true;
    return false;
  }

  const TemporaryFolder folder_;
};

TEST_F(DicomDisc, OnlyCtSeriesIsFoundAndTheRestNamed) {
  const LoadedCt loaded = read_dicom_ct(folder_.path());
  expect_shows_the_patient(loaded.volume, kRounding);
  EXPECT_TRUE(warned(loaded, "modality MR"));
  EXPECT_TRUE(warned(loaded, "3 files that are not DICOM"));
  EXPECT_TRUE(warned(loaded, "README.TXT"));
}

TEST_F(DicomDisc, SeriesAreListed) {
  const std::vector<DicomSeries> found = find_dicom_series(folder_.path());
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].modality, "MR");
  EXPECT_FALSE(found[0].is_ct);
  const DicomSeries& series = found[1];
  EXPECT_EQ(series.modality, "CT");
  EXPECT_TRUE(series.is_ct);
  EXPECT_EQ(series.series_uid, DicomSlice().series_uid);
  EXPECT_EQ(series.slices, 4);
  EXPECT_EQ(series.columns, 7);
  EXPECT_EQ(series.rows, 5);
  EXPECT_LT((series.spacing_mm - small_grid().spacing_mm).norm(), 1e-9);
  EXPECT_EQ(series.axes, (Eigen::Matrix<double, 3, 2>::Identity()));
  EXPECT_EQ(series.transfer_syntax_uid, "1.2.840.10008.1.2.1");
  EXPECT_EQ(series.series_number, 1);
  EXPECT_TRUE(series.problems.empty());
}

TEST_F(DicomDisc, OneOfSeveralCtSeriesMustBeChosen) {
  add_second_ct();
  DicomReadOptions options;
  expect_input_error([&] { read_dicom_ct(folder_.path()); },
                     {"2 CT series", "series_uid", "1.2.826.0.1.3680043.2.1.1",
                      "1.2.826.0.1.3680043.2.1.2", "4 slices of 7 x 5"});
  options.series_uid = "1.2.826.0.1.3680043.2.1.2";
  EXPECT_EQ(read_dicom_ct(folder_.path(), options).volume.at(3, 3, 3), 77);
  options.series_uid = "1.2.826.0.1.3680043.2.1.1";
  const LoadedCt first = read_dicom_ct(folder_.path(), options);
  expect_shows_the_patient(first.volume, kRounding);
  EXPECT_TRUE(warned(first, "1.2.826.0.1.3680043.2.1.2 of modality CT"));
  options.series_uid = "1.2.3";
  expect_input_error([&] { read_dicom_ct(folder_.path(), options); }, {"'1.2.3'", "among"});
}

/// DICOM allows 64 characters, and many programs use them all.
TEST_F(DicomDisc, AUidIsNamedAsTheOptionTakesIt) {
  const std::string longest = "1.2.826.0.1.3680043.8.498.12345678901234567890123456789012345678";
  ASSERT_EQ(longest.size(), 64U);
  add_second_ct(longest);
  expect_input_error([&] { read_dicom_ct(folder_.path()); }, {longest + ": CT, "});
  DicomReadOptions options;
  options.series_uid = longest;
  EXPECT_EQ(read_dicom_ct(folder_.path(), options).volume.at(3, 3, 3), 77);
}

TEST_F(DicomDisc, ASeriesThatNoOptionChoosesIsDescribedBesideTheOthers) {
  add_second_ct("");
  const std::string described = describe_dicom(folder_.path());
  EXPECT_THAT(described, testing::HasSubstr("'SeriesInstanceUID' is empty"));
  EXPECT_THAT(described, testing::HasSubstr(DicomSlice().series_uid));
}

TEST_F(DicomDisc, OneFileStandsForItsSeries) {
  add_second_ct();
  expect_shows_the_patient(read_dicom_ct(ct() / "slice_2.dcm").volume, kRounding);
  EXPECT_EQ(read_ct(folder_.path() / "study" / "ct2" / "slice_0.dcm").volume.at(1, 1, 1), 77);
  const auto found = find_dicom_series(ct() / "slice_2.dcm");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].slices, 4);
}

TEST_F(DicomDisc, ReadCtTakesImageFilesAsWell) {
  const TemporaryFolder other;
  const CtVolume volume = test::sampled(test::example_grids().back().grid);
  write_volume(volume, other.path() / "ct.nrrd");
  const LoadedCt loaded = read_ct(other.path() / "ct.nrrd");
  EXPECT_EQ(loaded.format, "NRRD");
  EXPECT_EQ(loaded.volume.voxels, volume.voxels);
  EXPECT_TRUE(loaded.series_uid.empty());
  fs::rename(ct(), folder_.path() / "study" / "ct.nii.gz");  // a folder may be called anything
  EXPECT_EQ(read_ct(folder_.path()).format, "DICOM");
  EXPECT_EQ(read_ct(folder_.path() / "study" / "ct.nii.gz").format, "DICOM");
}

TEST_F(DicomDisc, LocalizersReportsAndCapturesAreNoSlices) {
  DicomSlice localizer;
  localizer.image_type = "ORIGINAL\\PRIMARY\\LOCALIZER";
  localizer.axes << 0, 0, 1, 0, 0, 1;
  test::write_dicom(ct() / "scout.dcm", localizer);
  DicomSlice capture;
  capture.sop_class = "1.2.840.10008.5.1.4.1.1.7";
  capture.changes[{0x0020, 0x0032}] = std::nullopt;
  test::write_dicom(ct() / "dose.dcm", capture);
  const LoadedCt loaded = read_dicom_ct(folder_.path());
  expect_shows_the_patient(loaded.volume, kRounding);
  EXPECT_TRUE(warned(loaded, "1 localizers (scout.dcm)"));
  EXPECT_TRUE(warned(loaded, "no CT images (dose.dcm)"));
}

DicomSlice dose_report() {
  DicomSlice report;
  report.modality = "SR";
  report.sop_class = "1.2.840.10008.5.1.4.1.1.88.67";
  report.series_uid += ".9";
  report.changes[{0x7fe0, 0x0010}] = std::nullopt;
  return report;
}

/// States another transfer syntax, by the value's length as well.
void claim_to_be_deflated(const fs::path& path) {
  std::string bytes = test::read_text(path);
  const std::string plain(
      "\x02\x00\x10\x00UI\x14\x00"
      "1.2.840.10008.1.2.1\0",
      28);
  const std::string deflated(
      "\x02\x00\x10\x00UI\x16\x00"
      "1.2.840.10008.1.2.1.99",
      30);
  ASSERT_NE(bytes.find(plain), std::string::npos);
  test::write_text(path, bytes.replace(bytes.find(plain), plain.size(), deflated));
}

TEST_F(DicomDisc, WhatCannotBeReadAndIsNoCtIsPassedOver) {
  const fs::path deflated = ct() / "deflated.dcm";
  const fs::path padded = ct() / "padded.dcm";
  for (const fs::path& path : {deflated, padded}) test::write_dicom(path, dose_report());
  claim_to_be_deflated(deflated);
  test::write_text(padded, test::read_text(padded) + std::string(64, '\0'));
  const LoadedCt loaded = read_dicom_ct(folder_.path());
  expect_shows_the_patient(loaded.volume, kRounding);
  EXPECT_TRUE(warned(loaded,
                     "2 files that cannot be read, and state that they are no CT images "
                     "(deflated.dcm, padded.dcm)"));
  expect_shows_the_patient(read_dicom_ct(ct() / "slice_2.dcm").volume, kRounding);
  expect_input_error([&] { read_dicom_ct(deflated); }, {"deflated.dcm", "is not)"});
  expect_input_error([&] { read_dicom_ct(padded); }, {"padded.dcm", "damaged"});
}

TEST_F(DicomDisc, ADeflatedSliceIsNotPassedOver) {
  claim_to_be_deflated(ct() / "slice_2.dcm");
  expect_input_error([&] { read_dicom_ct(folder_.path()); }, {"slice_2.dcm", "deflated"});
}

TEST_F(DicomDisc, FilesWithoutPreambleAreDicom) {
  for (const auto& entry : fs::directory_iterator(ct()))
    if (entry.path().filename().string()[0] != '.')
      test::write_text(entry.path(), test::read_text(entry.path()).substr(132));
  fs::rename(ct() / "slice_2.dcm", ct() / "IM2");
  expect_shows_the_patient(read_dicom_ct(ct() / "IM2").volume, kRounding);
  EXPECT_EQ(detect_format(ct() / "IM2").name, "DICOM series");
  EXPECT_EQ(detect_format(ct() / "slice_1.dcm").name, "DICOM series");
  EXPECT_FALSE(is_dicom(folder_.path() / "README.TXT"));
  EXPECT_FALSE(is_dicom(ct() / "._slice_0.dcm"));
}

TEST_F(DicomDisc, TheSubfolderThatCannotBeReadIsNamed) {
  const fs::path other = folder_.path() / "study" / "reports";
  fs::create_directories(other);
  using fs::perms;
  fs::permissions(folder_.path(),
                  perms::group_read | perms::group_exec | perms::others_read | perms::others_exec,
                  fs::perm_options::add);
  const test::WithoutPermission lock(other);
  expect_input_error([&] { read_dicom_ct(folder_.path()); },
                     {other.string() + ": folder cannot be read", "Permission denied"});
}

TEST_F(DicomDisc, SameForAnyNumberOfThreadsWithProgress) {
  std::vector<double> fractions;
  const CtVolume one = test::with_threads(1, [&] {
    return read_dicom_ct(folder_.path(), {}, [&](double f) { fractions.push_back(f); }).volume;
  });
  const CtVolume four = test::with_threads(4, [&] { return read_dicom_ct(folder_.path()).volume; });
  EXPECT_EQ(one.voxels, four.voxels);
  EXPECT_TRUE(same_grid(one.grid, four.grid));
  EXPECT_EQ(fractions, (std::vector<double>{0.25, 0.5, 0.75, 1.0}));
}

TEST_F(DicomDisc, NoPatientIdentifierLeavesTheReader) {
  add_second_ct();
  std::string said;
  for (const DicomSeries& series : find_dicom_series(folder_.path())) {
    said += series.series_uid + series.modality + series.frame_of_reference_uid;
    for (const std::string& problem : series.problems) said += problem;
  }
  const auto read = [&](const fs::path& path) {
    try {
      const LoadedCt loaded = read_dicom_ct(path);
      for (const std::string& warning : loaded.warnings) said += warning;
    } catch (const InputError& error) {
      said += error.what();
    }
  };
  read(folder_.path());
  read(ct());
  for (const gdcm::Tag& tag : {gdcm::Tag(0x0028, 0x0010), gdcm::Tag(0x0020, 0x0032),
                               gdcm::Tag(0x0028, 0x1053), gdcm::Tag(0x0020, 0x000e)}) {
    DicomSlice bad;
    bad.changes[tag] = "?";
    test::write_dicom(ct() / "bad.dcm", bad);
    read(ct());
  }
  EXPECT_GT(said.size(), 500U);
  for (const std::string& identifier : test::patient_identifiers())
    EXPECT_EQ(said.find(identifier), std::string::npos) << identifier << " in " << said;
}

}  // namespace
}  // namespace usct
