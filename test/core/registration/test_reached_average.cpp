#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <future>

#include "core/registration/registration_cases.h"
#include "registration/images/reached_average.h"
#include "similarity/packed_ct.h"

namespace usct::test {
namespace {

using Eigen::Vector3i;

constexpr HuWindow kWindow{-150.0, 360.0};

ReachedAverage average_of(const Vector3i& size) {
  Volume<std::uint8_t> bytes;
  bytes.grid.size = size;
  bytes.grid.spacing_mm = {0.7, 0.9, 1.3};
  std::uint32_t state = 1;
  for (std::size_t i = 0; i < bytes.grid.voxel_count(); ++i) {
    state = state * 1664525U + 1013904223U;
    bytes.voxels.push_back(static_cast<std::uint8_t>(state >> 24U));
  }
  return {kWindow, {Vector3i::Ones()}, std::move(bytes)};
}

/// A region with voxels around it.
Region inner_region(const Vector3i& size) {
  Region region;
  for (int axis = 0; axis < 3; ++axis) {
    region.begin[axis] = *rc::gen::inRange(1, size[axis] - 2);
    region.size[axis] = *rc::gen::inRange(2, size[axis] - region.begin[axis]);
  }
  return region;
}

Region with_outermost(const Region& region) {
  return {region.begin - Vector3i::Ones(), region.size + Vector3i::Constant(2)};
}

/// The words of the voxels that have any, with pair and gradient.
std::vector<std::uint32_t> words_of(const PackedPart& part, const Grid& grid,
                                    const Region& region) {
  const PackedCt ct(part.voxels, region.begin - part.begin, region_grid(grid, region), 0.0);
  std::vector<std::uint32_t> all;
  for (int k = 0; k < region.size.z(); ++k)
    for (int j = 0; j + 1 < region.size.y(); ++j) {
      const std::uint32_t* row = ct.gradient().words + static_cast<std::size_t>(j) * ct.stride_j() +
                                 static_cast<std::size_t>(k) * ct.stride_k();
      all.insert(all.end(), row, row + region.size.x());
    }
  return all;
}

RC_GTEST_PROP(ReachedAverage, PartsAreThoseOfTheWholeWhateverWasReachedBefore, ()) {
  const Vector3i size(*rc::gen::inRange(5, 40), *rc::gen::inRange(5, 40), *rc::gen::inRange(5, 40));
  const ReachedAverage average = average_of(size);
  const Grid& grid = average.bytes().grid;
  const PackedPart all{std::make_shared<const PackedVoxels>(average.bytes(), kWindow),
                       Vector3i::Zero()};
  for (int turn = 0; turn < 3; ++turn) {
    const Region region = inner_region(size);
    RC_ASSERT(words_of(average.over(with_outermost(region)), grid, region) ==
              words_of(all, grid, region));
  }
}

TEST(ReachedAverage, WhatLiesNearOnePlaceIsPackedOnce) {
  const ReachedAverage average = average_of({100, 100, 100});
  EXPECT_EQ(average.memory(), 1000000U);
  const PackedPart first = average.over({{40, 40, 40}, {30, 30, 30}});
  const std::size_t memory = average.memory();
  EXPECT_EQ(average.over({{41, 42, 43}, {29, 28, 27}}).voxels, first.voxels);
  EXPECT_EQ(average.memory(), memory);
  // A little beyond, the part grows, and then serves both.
  const PackedPart grown = average.over({{36, 40, 40}, {30, 30, 30}});
  EXPECT_NE(grown.voxels, first.voxels);
  EXPECT_EQ(average.over({{40, 40, 40}, {30, 30, 30}}).voxels, grown.voxels);
}

TEST(ReachedAverage, KeepsNoVoxelsBetweenPlacesFarApart) {
  const ReachedAverage average = average_of({200, 40, 40});
  average.over({{0, 0, 0}, {40, 40, 40}});
  const std::size_t of_one_place = average.memory();
  average.over({{160, 0, 0}, {40, 40, 40}});
  EXPECT_EQ(average.memory(), of_one_place);
}

TEST(ReachedAverage, ThreadsThatReachItAtTheSameTimeGetTheirParts) {
  const ReachedAverage average = average_of({80, 80, 80});
  const Grid& grid = average.bytes().grid;
  const PackedPart all{std::make_shared<const PackedVoxels>(average.bytes(), kWindow),
                       Vector3i::Zero()};
  std::vector<std::future<bool>> right;
  for (int i = 0; i < 8; ++i)
    right.push_back(std::async(std::launch::async, [&, i] {
      const Region region{{5 * i + 1, 10, 10}, {20, 20, 20}};
      return words_of(average.over(with_outermost(region)), grid, region) ==
             words_of(all, grid, region);
    }));
  for (std::future<bool>& one : right) EXPECT_TRUE(one.get());
}

}  // namespace
}  // namespace usct::test
