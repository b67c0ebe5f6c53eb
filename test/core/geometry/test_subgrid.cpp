#include <gtest/gtest.h>

#include "us_ct_registration/geometry/subgrid.h"

namespace usct {
namespace {

Grid whole() {
  Grid grid;
  grid.size = {20, 30, 10};
  grid.spacing_mm = {0.5, 0.7, 2.0};
  grid.origin_mm = {-100.0, 30.0, 800.0};
  grid.direction = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  return grid;
}

/// Voxels 3 to 7, 10 to 29 and 2 to 4, stored with the axes in another order and one reversed.
Grid part() {
  const Grid of = whole();
  Grid grid;
  grid.size = {20, 3, 5};
  grid.spacing_mm = {0.7, 2.0, 0.5};
  grid.origin_mm = of.physical_from_index({3, 29, 2});
  grid.direction.col(0) = -of.direction.col(1);
  grid.direction.col(1) = of.direction.col(2);
  grid.direction.col(2) = of.direction.col(0);
  return grid;
}

TEST(Subgrid, IsAnyBlockOfTheVoxelsWhateverTheOrderOfTheAxes) {
  EXPECT_TRUE(is_subgrid(whole(), whole()));
  EXPECT_TRUE(is_subgrid(part(), whole()));
  EXPECT_FALSE(is_subgrid(whole(), part()));
}

TEST(Subgrid, PositionsMayBeRoundedButNotShifted) {
  Grid grid = part();
  grid.origin_mm.x() += 0.005;
  EXPECT_TRUE(is_subgrid(grid, whole()));
  grid.origin_mm.x() += 0.1;
  EXPECT_FALSE(is_subgrid(grid, whole()));
}

TEST(Subgrid, MustNotReachOutOrSkipVoxels) {
  Grid longer = part();
  ++longer.size[0];
  EXPECT_TRUE(is_subgrid(longer, whole()));
  longer.size[0] = 31;
  EXPECT_FALSE(is_subgrid(longer, whole()));
  Grid coarser = part();
  coarser.spacing_mm.x() *= 2.0;
  coarser.size[0] = 10;
  EXPECT_FALSE(is_subgrid(coarser, whole()));
}

}  // namespace
}  // namespace usct
