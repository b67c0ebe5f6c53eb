#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/rendering/surface.h"

namespace usct {
namespace {

constexpr double kRadius_mm = 20.0;
constexpr std::size_t kMany = 10'000'000;

/// A ball about `centre_mm`, on an oblique grid of unequal spacings that it does not fill.
Grid oblique_grid(bool mirrored) {
  Grid grid;
  grid.size = {70, 60, 40};
  grid.spacing_mm = {0.8, 0.9, 1.5};
  grid.direction = Eigen::AngleAxisd(0.6, Eigen::Vector3d(1, -2, 3).normalized()).matrix();
  if (mirrored) grid.direction.col(1) *= -1.0;
  grid.origin_mm = {-100.0, 35.0, 800.0};
  return grid;
}

template <typename T, typename F>
Volume<T> filled(const Grid& grid, F&& value) {
  Volume<T> volume(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        volume.at(i, j, k) =
            static_cast<T>(value(grid.physical_from_index(Eigen::Vector3d(i, j, k))));
  return volume;
}

/// Each edge has its opposite exactly once: the surface is closed and consistently oriented.
void expect_closed(const Surface& surface) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : surface.triangles)
    for (std::size_t i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  std::size_t open = 0;
  for (const auto& [edge, count] : edges)
    if (count != 1 || edges.count({edge.second, edge.first}) == 0) ++open;
  EXPECT_EQ(open, 0U) << "of " << edges.size();
}

/// Volume by the divergence theorem; positive if the triangles face outwards.
double volume_mm3(const Surface& surface) {
  double sum = 0.0;
  const Eigen::Vector3d origin = surface.points_mm.front();
  for (const auto& t : surface.triangles)
    sum += (surface.points_mm[t[0]] - origin)
               .dot((surface.points_mm[t[1]] - origin).cross(surface.points_mm[t[2]] - origin)) /
           6.0;
  return sum;
}

double worst_distance_mm(const Surface& surface, const Eigen::Vector3d& centre_mm) {
  double worst = 0.0;
  for (const Eigen::Vector3d& p : surface.points_mm)
    worst = std::max(worst, std::abs((p - centre_mm).norm() - kRadius_mm));
  return worst;
}

const double kBall_mm3 = 4.0 / 3.0 * kPi * std::pow(kRadius_mm, 3);

TEST(Surface, OfALabelledBallLiesWithinAVoxelOfItInAnyOrientation) {
  for (const bool mirrored : {false, true}) {
    const Grid grid = oblique_grid(mirrored);
    const Eigen::Vector3d centre = grid.centre_mm();
    const auto labels = filled<std::uint16_t>(grid, [&](const Eigen::Vector3d& p) {
      return (p - centre).norm() < kRadius_mm ? 7 : (p - centre).x() > 25.0 ? 300 : 0;
    });
    const std::map<int, Surface> surfaces = label_surfaces(labels, kMany);
    ASSERT_EQ(surfaces.size(), 2U);
    const Surface& ball = surfaces.at(7);
    expect_closed(ball);
    EXPECT_LT(worst_distance_mm(ball, centre), 0.5 * grid.spacing_mm.norm());
    EXPECT_NEAR(volume_mm3(ball), kBall_mm3, 0.01 * kBall_mm3);
    EXPECT_GT(surfaces.at(300).triangles.size(), 0U);
  }
}

TEST(Surface, OfAFieldThatRisesEvenlyLiesWithinATenthOfAVoxel) {
  for (const bool mirrored : {false, true}) {
    const Grid grid = oblique_grid(mirrored);
    const Eigen::Vector3d centre = grid.centre_mm();
    const auto ct = filled<std::int16_t>(grid, [&](const Eigen::Vector3d& p) {
      return std::lround(100.0 * (kRadius_mm - (p - centre).norm()));
    });
    const Surface ball = iso_surface(ct, 0.0, kMany);
    expect_closed(ball);
    EXPECT_LT(worst_distance_mm(ball, centre), 0.1 * grid.spacing_mm.minCoeff());
    EXPECT_NEAR(volume_mm3(ball), kBall_mm3, 0.01 * kBall_mm3);
  }
}

TEST(Surface, WithFewerTrianglesIsCoarserAndStillThere) {
  const Grid grid = oblique_grid(false);
  const Eigen::Vector3d centre = grid.centre_mm();
  const auto labels = filled<std::uint16_t>(
      grid, [&](const Eigen::Vector3d& p) { return (p - centre).norm() < kRadius_mm ? 1 : 0; });
  const Surface ball = label_surfaces(labels, 2000).at(1);
  EXPECT_LE(ball.triangles.size(), 2000U);
  EXPECT_GT(ball.triangles.size(), 500U);
  expect_closed(ball);
  EXPECT_LT(worst_distance_mm(ball, centre), 1.0);
}

TEST(Surface, OfWhatReachesTheBorderIsClosedThere) {
  const Grid grid = oblique_grid(false);
  const LabelVolume all(grid, 1);
  const Surface block = label_surfaces(all, kMany).at(1);
  expect_closed(block);
  const double volume = grid.spacing_mm.prod() * static_cast<double>(grid.voxel_count());
  EXPECT_NEAR(volume_mm3(block), volume, 0.01 * volume);
  expect_closed(iso_surface(CtVolume(grid, 50), 0.0, kMany));
}

TEST(Surface, ASingleVoxelHasOneAndNothingHasNone) {
  LabelVolume labels(oblique_grid(false));
  EXPECT_TRUE(label_surfaces(labels, kMany).empty());
  EXPECT_TRUE(iso_surface(CtVolume(labels.grid, -1000), 0.0, kMany).triangles.empty());
  labels.at(69, 0, 20) = 5;
  const Surface one = label_surfaces(labels, kMany).at(5);
  expect_closed(one);
  for (const Eigen::Vector3d& p : one.points_mm)
    EXPECT_LT((p - labels.grid.physical_from_index({69, 0, 20})).norm(),
              labels.grid.spacing_mm.norm());
}

TEST(Surface, TooFewTrianglesAreRefused) {
  EXPECT_THROW(iso_surface(CtVolume(oblique_grid(false)), -500.0, 999), InputError);
}

}  // namespace
}  // namespace usct
