#include <gtest/gtest.h>

#include <cmath>

#include "registration/search/block_sums.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Translation3d;
using Eigen::Vector3d;
using registration::BlockPlace;
using registration::BlockSums;
using registration::UltrasoundBlock;
using registration::UltrasoundCells;

/// HU that vary everywhere by waves of 12 to 60 mm in all directions, which do not repeat.
double pattern_hu(const Vector3d& p_mm) {
  double hu = 100.0;
  for (int wave = 0; wave < 16; ++wave) {
    const Vector3d direction(std::cos(2.4 * wave), std::sin(2.4 * wave), std::cos(1.1 * wave));
    hu += 30.0 * std::sin((0.1 + 0.012 * wave) * direction.dot(p_mm) + 1.7 * wave * wave);
  }
  return hu;
}

/// Ultrasound in a cube with a sample every 2 mm, as bright as a CT in the same place.
BeamUltrasound bright_as_ct(int edge_mm) {
  BeamUltrasound us;
  const int samples = edge_mm / 2;
  us.beams.lines = us.beams.frames = us.beams.axial.samples = samples;
  us.beams.axial.spacing_mm = 2.0;
  for (int f = 0; f < samples; ++f)
    for (int l = 0; l < samples; ++l) {
      us.beams.beams.push_back({Vector3d(2.0 * l, 2.0 * f, 0.0), Vector3d::UnitZ()});
      for (int s = 0; s < samples; ++s)
        us.brightness.push_back(static_cast<float>(pattern_hu({2.0 * l, 2.0 * f, 2.0 * s})));
    }
  us.known.assign(us.brightness.size(), 1);
  return us;
}

PackedCt ct_around(int edge_mm) {
  constexpr double kMarginMm = 60.0;
  Grid grid;
  grid.size.setConstant(static_cast<int>((edge_mm + 2.0 * kMarginMm) / 4.0));
  grid.spacing_mm.setConstant(4.0);
  grid.origin_mm.setConstant(-kMarginMm);
  Volume<float> ct(grid);
  std::size_t at = 0;
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        ct.voxels[at++] = static_cast<float>(pattern_hu(grid.origin_mm + 4.0 * Vector3d(i, j, k)));
  return {ct, {-150.0, 400.0}, 40.0};
}

class BlockSumsOf : public testing::TestWithParam<int> {
 protected:
  using Everywhere = BlockSums::Everywhere;
  BlockSums sums(std::vector<Matrix3d> rotations, double translation_mm,
                 Everywhere summed = Everywhere::kPart) const {
    const Vector3d middle_mm = Vector3d::Constant(0.5 * GetParam());
    return {cells_, blocks_, summed, std::move(rotations), translation_mm, middle_mm};
  }
  const UltrasoundCells cells_{bright_as_ct(GetParam()), Isometry3d::Identity(), 4.0};
  const std::vector<UltrasoundBlock> blocks_ = cells_.blocks();
  const PackedCt ct_ = ct_around(GetParam());
  const Matrix3d turn_ = Eigen::AngleAxisd(0.1, Vector3d(1, 2, 2) / 3.0).toRotationMatrix();
  // A motion of the CT by -(3, -2, 4) cells is right.
  const Isometry3d T_us_ct_{Translation3d(12.0, -8.0, 16.0)};
};

/// The right place is found, and all blocks count there, however many were summed everywhere.
TEST_P(BlockSumsOf, FindsTheRightPlaceByAllBlocks) {
  const BlockSums sums = this->sums({turn_, Matrix3d::Identity()}, 20.0);
  const std::vector<BlockPlace> places = sums.best(ct_, T_us_ct_);
  ASSERT_FALSE(places.empty());
  EXPECT_TRUE(sums.T_us_ct_at(places.front(), T_us_ct_).isApprox(Isometry3d::Identity(), 1e-9));
  const auto most = static_cast<double>(kPartsOfCell) * 64.0 * static_cast<double>(blocks_.size());
  EXPECT_GT(places.front().explained, 0.8 * most);
  EXPECT_LE(places.front().explained, most);
}

/// What is said of a place is so: sums that begin there find no less.
TEST_P(BlockSumsOf, ExplainsAsMuchAtEachPlaceAsItSays) {
  const std::vector<Matrix3d> rotations{turn_, Matrix3d::Identity()};
  const std::vector<BlockPlace> places = sums(rotations, 20.0).best(ct_, T_us_ct_);
  ASSERT_GE(places.size(), 4U);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const BlockPlace& place = places[i];
    const Isometry3d there = Translation3d(-4.0 * place.cells.cast<double>()) * T_us_ct_;
    const std::vector<BlockPlace> again = sums({rotations[place.rotation]}, 0.0).best(ct_, there);
    EXPECT_GE(again.front().explained, place.explained) << i;
    if (i > 0) {
      EXPECT_LE(place.explained, places[i - 1].explained);
    }
  }
}

/// The best place by all blocks everywhere is the best by a part of them, and counts as much.
TEST_P(BlockSumsOf, FindsByAPartWhatAllFind) {
  const std::vector<Matrix3d> rotations{turn_, Matrix3d::Identity()};
  const BlockPlace by_part = sums(rotations, 20.0).best(ct_, T_us_ct_).front();
  const BlockPlace by_all = sums(rotations, 20.0, Everywhere::kAll).best(ct_, T_us_ct_).front();
  EXPECT_EQ(by_part.rotation, by_all.rotation);
  EXPECT_EQ(by_part.cells, by_all.cells);
  EXPECT_EQ(by_part.explained, by_all.explained);
}

/// Of 64 blocks all are summed everywhere, and of 512 and 1000 a part.
INSTANTIATE_TEST_SUITE_P(Edges, BlockSumsOf, testing::Values(64, 128, 160));

}  // namespace
}  // namespace usct::test
