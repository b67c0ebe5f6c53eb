#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/similarity/patch_scenes.h"
#include "us_ct_registration/error.h"

namespace usct::test {
namespace {

/// Trilinear interpolation of the bytes of the cell about an index, HU.
double from_cell(const PackedCt& ct, const Eigen::Vector3d& index) {
  const Eigen::Vector3i cell = index.array().floor().cast<int>();
  const Eigen::Vector3d t = index - cell.cast<double>();
  double value = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3i step(corner & 1, (corner >> 1) & 1, corner >> 2);
    double weight = 1.0;
    for (int axis = 0; axis < 3; ++axis) weight *= step[axis] != 0 ? t[axis] : 1.0 - t[axis];
    const std::uint16_t pair =
        ct.pairs()[static_cast<std::size_t>(cell.z() + step.z()) * ct.stride_k() +
                   static_cast<std::size_t>(cell.y()) * ct.stride_j() +
                   static_cast<std::size_t>(cell.x() + step.x())];
    value += weight * static_cast<double>(step.y() != 0 ? pair >> 8 : pair & 0xFF);
  }
  return kWindow.low_hu + ct.step_hu() * value;
}

RC_GTEST_PROP(PackedCt, IsTheCtWithinTheWindowToHalfAStep, ()) {
  const Grid grid = random_grid();
  Volume<float> ct(grid);
  for (std::size_t i = 0; i < ct.voxels.size(); ++i)
    ct.voxels[i] = static_cast<float>(hashed(i) / 65.0 - 400.0);  // beyond the window at both ends
  const PackedCt packed(ct, kWindow, kBackgroundHu);
  for (float& hu : ct.voxels) hu = std::clamp(hu, -150.0F, 360.0F);
  for (int i = 0; i < 20; ++i) {
    Eigen::Vector3d index;
    for (int axis = 0; axis < 3; ++axis)
      index[axis] = uniform(0.0, (grid.size[axis] - 1) * 0.999999);
    const double expected = sample_at_index(ct, index, Interpolation::kTrilinear, Outside::edge());
    RC_ASSERT(std::abs(from_cell(packed, index) - expected) <= 0.5 * packed.step_hu() + 1e-3);
  }
}

TEST(PackedCt, WholeStepsAndTheBackgroundAreExact) {
  const Volume<float> ct = wavy_ct(oblique_grid({7, 6, 5}, {1.0, 1.0, 1.0}));
  const PackedCt packed(ct, kWindow, kBackgroundHu);
  EXPECT_EQ(packed.step_hu(), 2.0);
  EXPECT_EQ(packed.background(), 95.0);
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < 5; ++j)
      for (int i = 0; i < 6; ++i)
        EXPECT_EQ(from_cell(packed, Eigen::Vector3d(i, j, k)), ct.at(i, j, k));
}

TEST(PackedCt, RefusesWhatItCannotPack) {
  const Volume<float> ct = wavy_ct(oblique_grid({4, 4, 4}, {1.0, 1.0, 1.0}));
  EXPECT_THROW(PackedCt(ct, {100.0, 100.0}, 100.0), InputError);
  EXPECT_THROW(PackedCt(ct, kWindow, -200.0), InputError);
  EXPECT_THROW(PackedCt(wavy_ct(oblique_grid({4, 1, 4}, {1.0, 1.0, 1.0})), kWindow, 0.0),
               InputError);
  Volume<std::uint8_t> too_many;  // its voxels are not needed: the size alone is too large
  too_many.grid = oblique_grid({1024, 1024, 513}, {0.1, 0.1, 0.1});
  EXPECT_THROW(PackedVoxels(std::move(too_many), kWindow), InputError);
}

}  // namespace
}  // namespace usct::test
