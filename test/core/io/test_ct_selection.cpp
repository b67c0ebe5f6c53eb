#include <gtest/gtest.h>

#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/volumes/ct_selection.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

using Eigen::Vector3d;
using test::expect_input_error;

/// Each voxel holds its own index; the axes are those of the patient, i reversed.
CtVolume numbered() {
  Grid grid;
  grid.size = {10, 8, 6};
  grid.spacing_mm = {2.0, 1.0, 3.0};
  grid.origin_mm = {100.0, 50.0, -20.0};
  grid.direction = Vector3d(-1.0, -1.0, 1.0).asDiagonal();
  CtVolume ct(grid);
  for (std::size_t i = 0; i < ct.voxels.size(); ++i) ct.voxels[i] = static_cast<std::int16_t>(i);
  return ct;
}

Eigen::AlignedBox3d box(const Vector3d& a, const Vector3d& b) {
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

TEST(CtSelection, KeepsTheVoxelsOfABoxAtTheirPlaces) {
  const CtVolume whole = numbered();
  CtSelection selection;
  // From voxel (2, 3, 1) to (6, 5, 4).
  selection.box_mm =
      box(whole.grid.physical_from_index({2, 3, 1}), whole.grid.physical_from_index({6, 5, 4}));
  std::vector<std::string> warnings;
  const CtVolume part = selected(whole, selection, warnings);
  ASSERT_EQ(part.grid.size, Eigen::Vector3i(5, 3, 4));
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 5; ++i) {
        EXPECT_EQ(part.at(i, j, k), whole.at(i + 2, j + 3, k + 1));
        EXPECT_LT((part.grid.physical_from_index(Vector3d(i, j, k)) -
                   whole.grid.physical_from_index(Vector3d(i + 2, j + 3, k + 1)))
                      .norm(),
                  1e-9);
      }
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], "cropped from 10 x 8 x 6 to 5 x 3 x 4 voxels");
}

TEST(CtSelection, DecimatesToTheCentresOfBlocks) {
  CtVolume whole = numbered();
  whole.voxels.assign(whole.voxels.size(), -77);
  CtSelection selection;
  selection.decimation = 2;
  std::vector<std::string> warnings;
  const CtVolume coarse = selected(whole, selection, warnings);
  EXPECT_EQ(coarse.grid.size, Eigen::Vector3i(5, 4, 3));
  EXPECT_EQ(coarse.grid.spacing_mm, Vector3d(4.0, 2.0, 6.0));
  EXPECT_LT((coarse.grid.origin_mm - whole.grid.physical_from_index({0.5, 0.5, 0.5})).norm(), 1e-9);
  EXPECT_EQ(coarse.voxels, std::vector<std::int16_t>(60, -77));
  EXPECT_EQ(warnings.size(), 1u);
}

TEST(CtSelection, WithoutRequestNothingChanges) {
  std::vector<std::string> warnings;
  EXPECT_EQ(selected(numbered(), {}, warnings).voxels, numbered().voxels);
  EXPECT_TRUE(warnings.empty());
}

TEST(CtSelection, LimitsHoldBeforeAnythingIsRead) {
  Grid grid = numbered().grid;
  CtSelection selection;
  selection.max_stored_bytes = 1920;
  selection.max_kept_bytes = 960;
  EXPECT_NO_THROW(require_fits(selection, grid, 4, "ct"));
  expect_input_error([&] { require_fits(selection, grid, 8, "ct"); }, {"ct", "10 x 8 x 6", "file"});
  selection.max_kept_bytes = 959;
  expect_input_error([&] { require_fits(selection, grid, 2, "ct"); }, {"ct", "to keep"});
  selection.decimation = 2;
  EXPECT_NO_THROW(require_fits(selection, grid, 2, "ct"));
  // The product of these sizes is beyond 64 bits.
  grid.size = Eigen::Vector3i::Constant(2147483647);
  expect_input_error([&] { require_fits(selection, grid, 8, "ct"); }, {"file"});
}

TEST(CtSelection, BadRequestsAreNamed) {
  CtSelection outside;
  outside.box_mm = box({1e3, 1e3, 1e3}, {2e3, 2e3, 2e3});
  expect_input_error([&] { require_fits(outside, numbered().grid, 2, "ct"); }, {"0 x 0 x 0"});
  CtSelection flat;
  flat.box_mm = box({0.0, 0.0, 0.0}, {1.0, 0.0, 1.0});
  expect_input_error([&] { flat.validate(); }, {"differ along each axis"});
  CtSelection thin;
  thin.decimation = 7;
  expect_input_error([&] { require_fits(thin, numbered().grid, 2, "ct"); }, {"'decimation', 7"});
  thin.decimation = 0;
  expect_input_error([&] { thin.validate(); }, {"'decimation' is 0"});
}

TEST(CtSelection, IsThatOfAFile) {
  const test::TemporaryFolder folder;
  write_volume(numbered(), folder.path() / "ct.nrrd");
  CtSelection selection;
  selection.box_mm = box(numbered().grid.physical_from_index({2, 3, 1}),
                         numbered().grid.physical_from_index({6, 5, 4}));
  const LoadedCt part = read_ct(folder.path() / "ct.nrrd", {}, {}, selection);
  EXPECT_EQ(part.volume.grid.size, Eigen::Vector3i(5, 3, 4));
  EXPECT_EQ(part.whole_grid.size, Eigen::Vector3i(10, 8, 6));
  selection.max_stored_bytes = 959;
  expect_input_error([&] { read_ct(folder.path() / "ct.nrrd", {}, {}, selection); }, {"ct.nrrd"});
}

}  // namespace
}  // namespace usct
