#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/io/expect_input_error.h"
#include "random_geometry.h"
#include "us_ct_registration/geometry/grid.h"

namespace usct::test {
namespace {

using Eigen::Vector3d;

/// A mask of another place or orientation must not pass for that of a volume.
RC_GTEST_PROP(SameGrid, IsThatOfTheSamePlaces, ()) {
  const Grid grid = random_grid();
  RC_ASSERT(same_grid(grid, grid));
  Grid longer = grid;
  ++longer.size[integer(0, 3)];
  Grid wider = grid;
  wider.spacing_mm[integer(0, 3)] += 1e-3;
  Grid moved = grid;
  moved.origin_mm[integer(0, 3)] += 1e-3;
  Grid turned = grid;
  turned.direction = Eigen::AngleAxisd(1e-3, Vector3d::UnitX()) * grid.direction;
  Grid exchanged = grid;
  exchanged.direction.col(0).swap(exchanged.direction.col(1));
  for (const Grid& other : {longer, wider, moved, turned, exchanged})
    RC_ASSERT(!same_grid(grid, other));
}

TEST(Grid, AxesThatAreNotAtRightAnglesAreRefused) {
  Grid sheared;
  sheared.size = {2, 2, 2};
  sheared.direction.col(1) = Vector3d(0.01, 1.0, 0.0);
  expect_input_error([&] { sheared.validate("ct.nrrd"); }, {"ct.nrrd", "orthonormal"});
  Grid stretched;
  stretched.size = {2, 2, 2};
  stretched.direction.col(2) = Vector3d(0.0, 0.0, 1.01);
  expect_input_error([&] { stretched.validate("ct.nrrd"); }, {"ct.nrrd", "orthonormal"});
}

/// A grid that is larger than its box reaches out of it by as much on either side.
RC_GTEST_PROP(Grid, AroundABoxIsCentredOnItAndHoldsIt, ()) {
  const Vector3d min_mm(uniform(-90.0, 90.0), uniform(-90.0, 90.0), uniform(-90.0, 90.0));
  const Vector3d max_mm =
      min_mm + Vector3d(uniform(0.0, 50.0), uniform(0.0, 50.0), uniform(0.0, 50.0));
  const double spacing_mm = uniform(0.3, 4.0);
  const Grid grid = grid_around_box(min_mm, max_mm, spacing_mm);
  RC_ASSERT((grid.centre_mm() - 0.5 * (min_mm + max_mm)).norm() < 1e-9);
  const Vector3d last_mm = grid.physical_from_index((grid.size.array() - 1).cast<double>());
  RC_ASSERT(((last_mm - max_mm).array() > -1e-9).all());
  RC_ASSERT(((last_mm - max_mm).array() < spacing_mm).all());
}

}  // namespace
}  // namespace usct::test
