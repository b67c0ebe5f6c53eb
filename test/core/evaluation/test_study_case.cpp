#include <gtest/gtest.h>

#include "core/evaluation/small_study.h"
#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/evaluation/study_case.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

using Eigen::Vector3d;

TEST(StudyCase, IsReadAsPhantomsAreWritten) {
  const StudyCase written = small_case("patient_7", 3);
  const TemporaryFolder parent;
  const std::filesystem::path folder = parent.path() / "patient_7";
  std::filesystem::create_directory(folder);
  expect_input_error([&] { read_study_case(folder); }, {"patient_7", "has 0 of ct.nrrd"});
  write_volume(written.ct, folder / "ct.nii.gz");
  write_prescan_nrrd(written.ultrasound, folder / "us.nrrd");
  write_T_us_ct(written.T_us_ct_true, folder / "truth.tfm");
  write_points_mm(written.targets_us_mm, folder / "targets.csv");
  const StudyCase read = read_study_case(folder / "");
  EXPECT_EQ(read.name, "patient_7");
  EXPECT_EQ(read.group(), "patient");
  EXPECT_EQ(read.ct.voxels, written.ct.voxels);
  EXPECT_EQ(read.ultrasound.voxels, written.ultrasound.voxels);
  EXPECT_TRUE(read.T_us_ct_true.isApprox(written.T_us_ct_true, 1e-12));
  EXPECT_EQ(read.targets_us_mm, written.targets_us_mm);
  EXPECT_EQ(read.targets_ct_mm, ct_points_mm(read.T_us_ct_true, read.targets_us_mm));
  write_points_mm({{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10, 11, 12}}, folder / "targets_ct.csv");
  EXPECT_EQ(read_study_case(folder).targets_ct_mm[2], Vector3d(7, 8, 9));
  write_points_mm({{1, 2, 3}}, folder / "targets_ct.csv");
  expect_input_error([&] { read_study_case(folder); },
                     {"targets_ct.csv", "has 1 points", "as many as targets.csv, 4"});
  write_volume(written.ct, folder / "ct.mha");
  expect_input_error([&] { read_study_case(folder); }, {"has 2 of"});
}

TEST(StudyCase, AStrangerNeedsTheCtAndThePlaceOfItsKidney) {
  const StudyCase written = small_case("s_1", 3);
  const TemporaryFolder folder;
  write_volume(written.ct, folder.path() / "ct.nrrd");
  expect_input_error([&] { read_stranger(folder.path()); }, {"has no targets_ct.csv"});
  write_T_us_ct(written.T_us_ct_true, folder.path() / "truth.tfm");
  write_points_mm(written.targets_us_mm, folder.path() / "targets.csv");
  const StudyCase by_truth = read_stranger(folder.path());
  EXPECT_TRUE(by_truth.is_stranger);
  EXPECT_EQ(by_truth.ct.voxels, written.ct.voxels);
  EXPECT_LT((by_truth.centre_ct_mm() - written.centre_ct_mm()).norm(), 1e-9);
  write_points_mm({{1, 2, 3}, {3, 4, 5}}, folder.path() / "targets_ct.csv");
  EXPECT_EQ(read_stranger(folder.path()).centre_ct_mm(), Vector3d(2, 3, 4));
}

}  // namespace
}  // namespace usct::test
