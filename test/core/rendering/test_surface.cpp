#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <random>
#include <tuple>

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

/// The number of times that each edge of the triangles occurs, by its first and second point.
std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges_of(const Surface& surface) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : surface.triangles)
    for (std::size_t i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  return edges;
}

/// Each edge has its opposite as often: there is no hole, though the surface may touch itself.
void expect_closed(const Surface& surface, int most_often = 1) {
  const auto edges = edges_of(surface);
  std::size_t open = 0;
  for (const auto& [edge, count] : edges) {
    const auto opposite = edges.find({edge.second, edge.first});
    if (count > most_often || opposite == edges.end() || opposite->second != count) ++open;
  }
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

/// The finest surface of a mask is accurate to half a voxel; smoothing must do better.
TEST(Surface, OfALabelledBallIsSmootherThanItsVoxels) {
  Grid grid;
  grid.size = {60, 60, 60};
  const Eigen::Vector3d centre = grid.centre_mm() + Eigen::Vector3d(0.13, 0.21, -0.3);
  const auto labels = filled<std::uint16_t>(
      grid, [&](const Eigen::Vector3d& p) { return (p - centre).norm() < kRadius_mm ? 1 : 0; });
  for (const std::size_t most : {kMany, std::size_t{5000}}) {
    const Surface ball = label_surfaces(labels, most).at(1);
    EXPECT_LE(ball.triangles.size(), most);
    expect_closed(ball);
    double squares = 0.0;
    for (const Eigen::Vector3d& p : ball.points_mm)
      squares += std::pow((p - centre).norm() - kRadius_mm, 2);
    EXPECT_LT(std::sqrt(squares / static_cast<double>(ball.points_mm.size())), 0.1);
    EXPECT_NEAR(volume_mm3(ball), kBall_mm3, 0.01 * kBall_mm3);
  }
}

/// A tube of 4 mm is thinner than the voxels of a coarse grid would be; it must not break.
TEST(Surface, OfALongThinTubeKeepsItsLengthWithinAFewTriangles) {
  Grid grid;
  grid.size = {20, 20, 240};
  grid.spacing_mm = {0.8, 0.8, 0.8};
  const Eigen::Vector3d centre = grid.centre_mm();
  const auto labels = filled<std::uint16_t>(grid, [&](const Eigen::Vector3d& p) {
    return std::hypot(p.x() - centre.x(), p.y() - centre.y()) < 2.0 &&
                   std::abs(p.z() - centre.z()) < 80.0
               ? 1
               : 0;
  });
  const Surface tube = label_surfaces(labels, 2000).at(1);
  EXPECT_LE(tube.triangles.size(), 2000U);
  expect_closed(tube);
  const double volume = kPi * 4.0 * 160.0;
  EXPECT_NEAR(volume_mm3(tube), volume, 0.25 * volume);
  for (const double end : {-80.0, 80.0}) {
    double nearest_mm = 1e9;
    for (const Eigen::Vector3d& p : tube.points_mm)
      nearest_mm = std::min(nearest_mm, (p - centre - Eigen::Vector3d(0, 0, end)).norm());
    EXPECT_LT(nearest_mm, 3.0);
  }
}

TEST(Surface, OfNoiseIsClosedAndKeepsItsBound) {
  std::mt19937 random(5);
  const auto ct = filled<std::int16_t>(oblique_grid(true), [&](const Eigen::Vector3d&) {
    return static_cast<int>(random() % 2000) - 1000;
  });
  const Surface noise = iso_surface(ct, 0.0, 20000);
  EXPECT_LE(noise.triangles.size(), 20000U);
  EXPECT_GT(noise.triangles.size(), 0U);
  expect_closed(noise, 2);
}

/// A sheet of one voxel vanishes on every coarser grid.
TEST(Surface, OfAThinSheetIsThereWithFewTriangles) {
  Grid grid;
  grid.size = {160, 150, 5};
  LabelVolume labels(grid, 0);
  for (int j = 5; j < 145; ++j)
    for (int i = 5; i < 155; ++i) labels.at(i, j, 2) = 7;
  const Surface sheet = label_surfaces(labels, 1000).at(7);
  ASSERT_FALSE(sheet.triangles.empty());
  EXPECT_LE(sheet.triangles.size(), 1000U);
  expect_closed(sheet);
  for (const Eigen::Vector3d& p : sheet.points_mm) EXPECT_NEAR(p.z(), 2.0, 1.0);
}

/// A capsule or a vessel: a grid that is too coarse for it leaves holes, or a few triangles.
TEST(Surface, OfAThinShellKeepsItsVolumeOrIsNamed) {
  Grid grid;
  grid.size = {96, 96, 96};
  grid.spacing_mm = {0.75, 0.75, 0.75};
  const Eigen::Vector3d centre = grid.centre_mm();
  const auto labels = filled<std::uint16_t>(grid, [&](const Eigen::Vector3d& p) {
    return std::abs((p - centre).norm() - 30.0) < 1.0 ? 7 : 0;
  });
  const auto voxels = std::count(labels.voxels.begin(), labels.voxels.end(), 7);
  const double expected_mm3 = static_cast<double>(voxels) * grid.spacing_mm.prod();
  for (const std::size_t most : {1000UL, 2000UL, 5000UL, 20000UL, 200000UL}) {
    const std::map<int, Surface> surfaces = label_surfaces(labels, most);
    EXPECT_LE(surfaces.at(7).triangles.size(), most);
    const std::string warning = loss_warning(labels, surfaces, most, {});
    const bool is_whole = volume_mm3(surfaces.at(7)) > 0.75 * expected_mm3;
    EXPECT_EQ(is_whole, warning.empty()) << most << ": " << warning;
    EXPECT_TRUE(is_whole || most < 200000);
    EXPECT_TRUE(is_whole || warning.find("'7 label' keeps ") != std::string::npos) << warning;
  }
}

TEST(Surface, ABranchThatIsCutOffIsNamed) {
  Grid grid;
  grid.size = {100, 60, 60};
  const Eigen::Vector3d centre(30.0, 30.0, 30.0);
  LabelVolume labels(grid, 0);
  labels = filled<std::uint16_t>(
      grid, [&](const Eigen::Vector3d& p) { return (p - centre).norm() < 25.0 ? 3 : 0; });
  const std::map<int, Surface> without = label_surfaces(labels, 2000);
  EXPECT_EQ(loss_warning(labels, without, 2000, {}), "");
  for (int i = 55; i < 70; ++i) labels.at(i, 30, 30) = 3;
  EXPECT_NE(loss_warning(labels, without, 2000, {}).find("'3 label' ends 1"), std::string::npos);
  EXPECT_NE(loss_warning(labels, {{3, {}}}, 2000, {}).find("'3 label' has no surface"),
            std::string::npos);
}

TEST(Surface, LabelsThatTheBorderCutsAreNamed) {
  Grid grid;
  grid.size = {12, 10, 8};
  LabelVolume labels(grid, 0);
  const LabelTable table{{2, {"tumour", std::nullopt}}, {3, {"artery", std::nullopt}}};
  for (const auto& [i, j, k] :
       {std::tuple(0, 4, 4), {11, 4, 4}, {5, 0, 4}, {5, 9, 4}, {5, 4, 0}, {5, 4, 7}}) {
    LabelVolume cut = labels;
    cut.at(i, j, k) = 2;
    cut.at(5, 5, 5) = 3;
    EXPECT_EQ(border_warning(cut, table),
              "the label map ends inside '2 tumour': surfaces end there in planes");
  }
  labels.at(1, 1, 1) = 2;
  labels.at(10, 8, 6) = 3;
  EXPECT_EQ(border_warning(labels, table), "");
  labels.at(0, 0, 0) = 2;
  labels.at(11, 9, 7) = 3;
  EXPECT_EQ(border_warning(labels, table),
            "the label map ends inside '2 tumour', '3 artery': surfaces end there in planes");
}

TEST(Surface, TooFewTrianglesAreRefused) {
  EXPECT_THROW(iso_surface(CtVolume(oblique_grid(false)), -500.0, 999), InputError);
}

}  // namespace
}  // namespace usct
