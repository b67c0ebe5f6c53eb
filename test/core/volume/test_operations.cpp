#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/volume/operations.h"
#include "with_threads.h"

namespace usct {
namespace {

double uniform(double low, double high) {
  return low + (high - low) * (*rc::gen::inRange(0, 1000001)) * 1e-6;
}

Eigen::Matrix3d random_rotation() {
  const Eigen::Vector3d axis(uniform(-1, 1), uniform(-1, 1), uniform(0.1, 1));
  return Eigen::AngleAxisd(uniform(-3, 3), axis.normalized()).toRotationMatrix();
}

/// A random valid grid: oblique, permuted, flipped.
Grid random_grid(int min_size, int max_size) {
  Grid grid;
  for (int a = 0; a < 3; ++a) {
    grid.size[a] = *rc::gen::inRange(min_size, max_size + 1);
    grid.spacing_mm[a] = uniform(0.2, 3.0);
    grid.origin_mm[a] = uniform(-100, 100);
  }
  grid.direction = random_rotation();
  if (*rc::gen::arbitrary<bool>()) grid.direction.col(1) *= -1.0;
  if (*rc::gen::arbitrary<bool>()) grid.direction.col(0).swap(grid.direction.col(2));
  return grid;
}

/// A volume that holds f(p_mm) at every voxel.
template <typename F>
Volume<float> volume_of(const Grid& grid, const F& f) {
  Volume<float> volume(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        volume.at(i, j, k) =
            static_cast<float>(f(grid.physical_from_index(Eigen::Vector3d(i, j, k))));
  return volume;
}

RC_GTEST_PROP(Grid, IndexAndPhysicalAreInverse, ()) {
  const Grid grid = random_grid(1, 300);
  const Eigen::Vector3d index(uniform(-50, 300), uniform(-50, 300), uniform(-50, 300));
  RC_ASSERT((grid.index_from_physical(grid.physical_from_index(index)) - index).norm() < 1e-9);
  RC_ASSERT((grid.T_physical_index() * index - grid.physical_from_index(index)).norm() < 1e-9);
  RC_ASSERT((grid.T_index_physical() * grid.T_physical_index() * index - index).norm() < 1e-9);
}

TEST(Grid, ValidationNamesTheValueAndTheConstraint) {
  const auto message = [](const Grid& grid) {
    try {
      grid.validate("ct.nrrd");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  Grid good;
  good.size = {2, 2, 2};
  EXPECT_EQ(message(good), "no error");
  Grid bad = good;
  bad.size.y() = 0;
  EXPECT_EQ(message(bad), "ct.nrrd: size is 2 0 2, must be >= 1 along each axis");
  bad = good;
  bad.spacing_mm.z() = std::nan("");
  EXPECT_NE(message(bad).find("nan mm, must be finite and > 0"), std::string::npos);
  bad = good;
  bad.direction(0, 1) = 0.2;  // shear: gantry tilt
  EXPECT_NE(message(bad).find("orthonormal"), std::string::npos);
  bad = good;
  bad.size.setConstant(2000000000);
  EXPECT_NE(message(bad).find("more voxels than memory"), std::string::npos);
}

RC_GTEST_PROP(Resample, KeepsAnAffineFunctionUnderAnyPose, ()) {
  // The source covers the target for all poses, so that every sample is interpolated.
  Grid source_grid = random_grid(20, 24);
  source_grid.spacing_mm.setConstant(2.0);
  const Eigen::Vector3d gradient(uniform(-2, 2), uniform(-2, 2), uniform(-2, 2));
  const auto f = [&](const Eigen::Vector3d& p) { return gradient.dot(p); };
  const Volume<float> source = volume_of(source_grid, f);

  Grid target = random_grid(5, 6);
  target.spacing_mm.setConstant(1.5);
  Eigen::Isometry3d T_source_target = Eigen::Isometry3d::Identity();
  T_source_target.linear() = random_rotation();
  T_source_target.translation() =
      source_grid.centre_mm() - T_source_target.linear() * target.centre_mm();

  const Volume<float> result =
      resample(source, target, T_source_target, Interpolation::kTrilinear, Outside::constant(1e9F));
  const Volume<float> expected =
      volume_of(target, [&](const Eigen::Vector3d& p) { return f(T_source_target * p); });
  for (std::size_t i = 0; i < result.voxels.size(); ++i)
    RC_ASSERT(std::abs(result.voxels[i] - expected.voxels[i]) < 2e-3);
}

TEST(Sampling, OutsideIsWhatTheCallerSays) {
  Grid grid;
  grid.size = {2, 1, 1};
  Volume<std::int16_t> volume(grid);
  volume.voxels = {10, 20};
  const auto at = [&](double x, Outside outside) {
    return sample_at_index(volume, {x, 0, 0}, Interpolation::kTrilinear, outside);
  };
  EXPECT_EQ(at(0.25, Outside::constant(-1)), 12.5F);
  EXPECT_EQ(at(-0.4, Outside::constant(-1)), 10.0F);  // the outermost half voxel is inside
  EXPECT_EQ(at(-0.6, Outside::constant(-1)), -1.0F);
  EXPECT_EQ(at(1.6, Outside::constant(-1)), -1.0F);
  EXPECT_EQ(at(1.6, Outside::edge()), 20.0F);
  EXPECT_EQ(at(-1e300, Outside::edge()), 10.0F);
  EXPECT_EQ(at(std::nan(""), Outside::constant(-1)), -1.0F);
  EXPECT_TRUE(std::isnan(at(std::nan(""), Outside::edge())));
  EXPECT_EQ(sample_at_index(volume, {0.6, 0, 0}, Interpolation::kNearest, Outside::constant(-1)),
            20.0F);
}

TEST(Resample, RoundsAndClampsToTheVoxelType) {
  Grid grid;
  grid.size = {2, 1, 1};
  Volume<std::uint8_t> volume(grid);
  volume.voxels = {10, 13};
  Grid finer = grid;
  finer.size.x() = 3;
  finer.spacing_mm.x() = 0.5;
  const auto result = resample(volume, finer, Eigen::Isometry3d::Identity(),
                               Interpolation::kTrilinear, Outside::constant(300));
  EXPECT_EQ(result.voxels, (std::vector<std::uint8_t>{10, 12, 13}));
  finer.origin_mm.x() = 5.0;
  EXPECT_EQ(resample(volume, finer, Eigen::Isometry3d::Identity(), Interpolation::kTrilinear,
                     Outside::constant(300))
                .voxels,
            (std::vector<std::uint8_t>{255, 255, 255}));
}

RC_GTEST_PROP(Crop, KeepsEveryVoxelWhereItWas, ()) {
  const Grid grid = random_grid(3, 9);
  const Eigen::Vector3d weights(1.0, 20.0, 400.0);
  const Volume<float> volume = volume_of(grid, [&](const Eigen::Vector3d& p) {
    return weights.dot(grid.index_from_physical(p).array().round().matrix());
  });
  Region region;
  for (int a = 0; a < 3; ++a) {
    region.begin[a] = *rc::gen::inRange(0, grid.size[a]);
    region.size[a] = *rc::gen::inRange(1, grid.size[a] - region.begin[a] + 1);
  }
  const Volume<float> part = crop(volume, region);
  for (int k = 0; k < region.size.z(); ++k)
    for (int j = 0; j < region.size.y(); ++j)
      for (int i = 0; i < region.size.x(); ++i) {
        const Eigen::Vector3d p = part.grid.physical_from_index(Eigen::Vector3d(i, j, k));
        RC_ASSERT(part.at(i, j, k) ==
                  sample(volume, p, Interpolation::kNearest, Outside::constant(-1)));
      }
}

TEST(Crop, RefusesRegionsThatAreNotInTheVolume) {
  Grid grid;
  grid.size = {4, 4, 4};
  const Volume<float> volume(grid);
  EXPECT_THROW(crop(volume, {{0, 0, 0}, {5, 1, 1}}), InputError);
  EXPECT_THROW(crop(volume, {{-1, 0, 0}, {1, 1, 1}}), InputError);
  EXPECT_THROW(crop(volume, {{0, 0, 0}, {0, 1, 1}}), InputError);
}

TEST(RegionAround, ClipsToTheGridAndIsEmptyBeyondIt) {
  Grid grid;
  grid.size = {10, 10, 10};
  grid.spacing_mm.setConstant(2.0);
  const Region region = region_around(grid, {{4.1, 4.1, 4.1}, {1e9, 4.1, 4.1}}, 1.0);
  EXPECT_EQ(region.begin, Eigen::Vector3i(1, 1, 1));
  EXPECT_EQ(region.size, Eigen::Vector3i(9, 3, 3));
  EXPECT_EQ(region_around(grid, {{-50, 0, 0}}, 1.0).size, Eigen::Vector3i(0, 0, 0));
}

/// The sum that smoothing approximates, voxel by voxel and without separability.
double direct_gaussian(const Volume<float>& volume, const Eigen::Vector3i& at,
                       const Eigen::Vector3d& sigma_voxels) {
  double sum = 0.0;
  double weight_sum = 0.0;
  const Eigen::Vector3i reach = (3.0 * sigma_voxels).array().floor().cast<int>();
  for (int dz = -reach.z(); dz <= reach.z(); ++dz)
    for (int dy = -reach.y(); dy <= reach.y(); ++dy)
      for (int dx = -reach.x(); dx <= reach.x(); ++dx) {
        double exponent = 0.0;
        const Eigen::Vector3i d(dx, dy, dz);
        for (int a = 0; a < 3; ++a)
          if (sigma_voxels[a] > 0) exponent += std::pow(d[a] / sigma_voxels[a], 2);
        const double weight = std::exp(-0.5 * exponent);
        const Eigen::Vector3i from =
            (at + d).cwiseMax(0).cwiseMin(volume.grid.size - Eigen::Vector3i::Ones());
        sum += weight * volume.at(from.x(), from.y(), from.z());
        weight_sum += weight;
      }
  return sum / weight_sum;
}

RC_GTEST_PROP(SmoothGaussian, EqualsTheDirectSumOnAnyRegion, ()) {
  const Grid grid = random_grid(2, 8);
  Volume<float> volume(grid);
  for (float& v : volume.voxels) v = static_cast<float>(uniform(-10, 10));
  Eigen::Vector3d sigma_voxels;
  Region region;
  for (int a = 0; a < 3; ++a) {
    sigma_voxels[a] = *rc::gen::element(0.0, 0.7, 1.55);
    region.begin[a] = *rc::gen::inRange(0, grid.size[a]);
    region.size[a] = *rc::gen::inRange(1, grid.size[a] - region.begin[a] + 1);
  }
  const Volume<float> smooth =
      smooth_gaussian(volume, sigma_voxels.cwiseProduct(grid.spacing_mm), region);
  for (int k = 0; k < region.size.z(); ++k)
    for (int j = 0; j < region.size.y(); ++j)
      for (int i = 0; i < region.size.x(); ++i)
        RC_ASSERT(std::abs(smooth.at(i, j, k) -
                           direct_gaussian(volume, region.begin + Eigen::Vector3i(i, j, k),
                                           sigma_voxels)) < 1e-4);
}

RC_GTEST_PROP(Shrink, KeepsAnAffineFunctionAwayFromTheEdges, ()) {
  // A symmetric kernel about the block's centre preserves an affine function if and only if the
  // voxels of the result are placed at the blocks' centres.
  Grid grid = random_grid(40, 44);
  grid.spacing_mm = grid.spacing_mm.cwiseMin(1.0);
  const Eigen::Vector3d gradient(uniform(-2, 2), uniform(-2, 2), uniform(-2, 2));
  const auto f = [&](const Eigen::Vector3d& p) { return gradient.dot(p - grid.centre_mm()); };
  const Volume<float> volume = volume_of(grid, f);
  const Eigen::Vector3i factors(*rc::gen::inRange(1, 5), *rc::gen::inRange(1, 5),
                                *rc::gen::inRange(1, 5));
  // 3 sigma = 1.5 * 4 voxels from the edge.
  const Region inner{{6, 6, 6}, grid.size - Eigen::Vector3i(12, 12, 12)};
  const Volume<float> small = shrink(volume, factors, inner);
  const Volume<float> expected = volume_of(small.grid, f);
  for (std::size_t i = 0; i < small.voxels.size(); ++i)
    RC_ASSERT(std::abs(small.voxels[i] - expected.voxels[i]) < 2e-3);
}

TEST(Shrink, SuppressesWhatTheSmallGridCannotHold) {
  Grid grid;
  grid.size = {64, 4, 4};
  const Volume<float> volume =
      volume_of(grid, [](const Eigen::Vector3d& p) { return std::cos(kPi * p.x()); });
  const Region away_from_the_edges{{8, 0, 0}, {48, 4, 4}};
  for (const float v : shrink(volume, {4, 1, 1}, away_from_the_edges).voxels)
    EXPECT_LT(std::abs(v), 0.02);
}

TEST(Shrink, RefusesFactorsThatLeaveNothing) {
  Grid grid;
  grid.size = {4, 4, 4};
  const Volume<float> volume(grid);
  EXPECT_THROW(shrink(volume, {0, 1, 1}, whole(grid)), InputError);
  EXPECT_THROW(shrink(volume, {5, 1, 1}, whole(grid)), InputError);
}

TEST(Operations, GiveTheSameBitsWithAnyNumberOfThreads) {
  Grid grid;
  grid.size = {40, 30, 20};
  const Volume<float> volume = volume_of(grid, [](const Eigen::Vector3d& p) {
    return std::sin(p.x()) * std::cos(2 * p.y()) + 0.1 * p.z();
  });
  const auto smooth = [&] { return smooth_gaussian(volume, {1.3, 2.1, 0.8}, whole(grid)); };
  const auto small = [&] { return shrink(volume, {3, 2, 2}, whole(grid)); };
  EXPECT_EQ(test::with_threads(1, smooth).voxels, test::with_threads(4, smooth).voxels);
  EXPECT_EQ(test::with_threads(1, small).voxels, test::with_threads(4, small).voxels);
}

RC_GTEST_PROP(ReorientToAxes, MovesNoVoxelInSpace, ()) {
  Grid grid = random_grid(2, 5);
  Volume<std::int16_t> volume(grid);
  for (std::size_t i = 0; i < volume.voxels.size(); ++i)
    volume.voxels[i] = static_cast<std::int16_t>(i);
  const auto result = reorient_to_axes(volume);
  RC_ASSERT(result.grid.voxel_count() == grid.voxel_count());
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const Eigen::Vector3d p = grid.physical_from_index(Eigen::Vector3d(i, j, k));
        RC_ASSERT(sample(result, p, Interpolation::kNearest, Outside::constant(-1)) ==
                  static_cast<float>(volume.at(i, j, k)));
      }
  for (int a = 0; a < 3; ++a) RC_ASSERT(result.grid.direction(a, a) > 0.0);
}

}  // namespace
}  // namespace usct
