#include <gtest/gtest.h>

#include <cmath>

#include "core/io/expect_input_error.h"
#include "phantom/scenes.h"
#include "phantom/signed_distance.h"
#include "test_data.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom::test {
namespace {

using Eigen::Vector3d;

const Vector3d kKidneyCentre(60.0, 30.0, 0.0);
const Vector3d kKidneyAxes(24.0, 22.0, 48.0);

double ellipsoid(const Vector3d& p) {
  return (p - kKidneyCentre).cwiseQuotient(kKidneyAxes).norm();
}

struct Input {
  CtVolume ct;
  LabelVolume labels;
  FromCtOptions from_ct;
};

/// A body of 3 mm voxels: soft tissue with an ellipsoid kidney (label 7) in fat, a spine, a table
/// beside it in the air.
Input cylinder_body() {
  Grid grid;
  grid.size = {110, 90, 50};
  grid.spacing_mm = {3.0, 3.0, 3.0};
  grid.origin_mm = {-163.5, -133.5, -73.5};
  Input input{CtVolume(grid, -1000), LabelVolume(grid), {}};
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const Vector3d p = grid.physical_from_index(Vector3d(i, j, k));
        std::int16_t& hu = input.ct.at(i, j, k);
        if (std::hypot(p.x() / 130.0, p.y() / 90.0) < 1.0) hu = 50;
        if (p.y() > 110.0 && p.y() < 118.0) hu = 100;  // the table
        if (ellipsoid(p) < 1.5) hu = -95;
        if (ellipsoid(p) < 1.0) {
          hu = 35;
          input.labels.at(i, j, k) = 7;
        }
        if (std::hypot(p.x(), p.y() - 40.0) < 20.0) hu = 500;
      }
  input.from_ct.tissue_of_label[7] = Tissue::kCortex;
  input.from_ct.kidney_label = 7;
  return input;
}

TEST(SignedDistance, OfABallIsTheDistanceToItsSurface) {
  Grid grid;
  grid.size = {40, 40, 40};
  grid.spacing_mm = {1.5, 1.0, 2.0};
  grid.origin_mm = {-29.25, -19.5, -39.0};
  MaskVolume mask(grid);
  for (int k = 0; k < 40; ++k)
    for (int j = 0; j < 40; ++j)
      for (int i = 0; i < 40; ++i)
        mask.at(i, j, k) = grid.physical_from_index(Vector3d(i, j, k)).norm() < 14.0 ? 255 : 0;
  const Volume<float> distance = signed_distance(mask);
  for (int k = 0; k < 40; ++k)
    for (int j = 0; j < 40; ++j)
      for (int i = 0; i < 40; ++i) {
        const double expected = grid.physical_from_index(Vector3d(i, j, k)).norm() - 14.0;
        ASSERT_NEAR(distance.at(i, j, k), expected, 1.4) << i << " " << j << " " << k;
      }
}

TEST(FromCt, LabelsOfThreeMillimetresGiveASmoothKidney) {
  const Input input = cylinder_body();
  const Scene scene = make_ct_scene(1, input.ct, input.labels, input.from_ct, {});
  ASSERT_EQ(scene.kidney_surface_ct_mm.size(), static_cast<std::size_t>(kTargetCount));
  EXPECT_LT((scene.kidney_centre_ct_mm - kKidneyCentre).norm(), 0.3);
  double squares = 0.0;
  for (const Vector3d& p : scene.kidney_surface_ct_mm) {
    // Distance to the true surface, to first order.
    const double rho = ellipsoid(p);
    const double slope = (p - kKidneyCentre).cwiseQuotient(kKidneyAxes.cwiseAbs2()).norm() / rho;
    squares += std::pow((rho - 1.0) / slope, 2);
  }
  // A staircase of 3 mm voxels would be off by 3 / sqrt(12) = 0.87 mm.
  EXPECT_LT(std::sqrt(squares / kTargetCount), 0.6);
}

TEST(FromCt, TheProbeIsHeldOutsideAndLooksAtTheKidney) {
  const Input input = cylinder_body();
  for (const Approach approach :
       {Approach::kAuto, Approach::kLateral, Approach::kPosterior, Approach::kAnterior}) {
    FromCtOptions from_ct = input.from_ct;
    from_ct.approach = approach;
    const Scene scene = make_ct_scene(3, input.ct, input.labels, from_ct, {});
    const Vector3d contact = scene.T_ct_probe.translation();
    EXPECT_GE(std::hypot(contact.x() / 130.0, contact.y() / 90.0), 0.99);
    const Vector3d kidney = scene.T_ct_probe.inverse() * kKidneyCentre;
    EXPECT_GT(kidney.y(), 20.0);
    EXPECT_LT(std::hypot(kidney.x(), kidney.z()), 0.35 * kidney.y());
    const Vector3d look = scene.T_ct_probe.linear().col(1);
    if (approach == Approach::kLateral) {
      EXPECT_LT(look.x(), -0.7);
    }
    if (approach == Approach::kPosterior) {
      EXPECT_LT(look.y(), -0.3);
    }
    if (approach == Approach::kAnterior) {
      EXPECT_GT(look.y(), 0.3);
    }
  }
}

TEST(FromCt, HandsOutTheCtItselfAndShowsTheKidney) {
  const Input input = cylinder_body();
  PhantomOptions options;
  options.scene = SceneKind::kFromCt;
  options.from_ct = input.from_ct;
  options.sweep.samples = 100;
  options.sweep.lines = 40;
  options.sweep.frames = 10;
  options.sweep.lateral_fov_deg = 50.0;
  options.sweep.elevation_fov_deg = 10.0;
  const PhantomCase phantom = make_phantom_from_ct(input.ct, input.labels, options);
  EXPECT_EQ(phantom.ct.voxels, input.ct.voxels);
  EXPECT_TRUE(same_grid(phantom.ct.grid, input.ct.grid));
  EXPECT_TRUE(same_grid(phantom.labels.grid, input.ct.grid));
  // Fat around the kidney is brighter than its cortex, as in a person.
  const Eigen::Isometry3d T_ct_us = phantom.truth.T_us_ct.inverse();
  double cortex = 0.0;
  double fat = 0.0;
  int cortex_count = 0;
  int fat_count = 0;
  const auto& us = phantom.ultrasound;
  for (int f = 0; f < 10; ++f)
    for (int l = 0; l < 40; ++l)
      for (int s = 0; s < 100; ++s) {
        const double rho = ellipsoid(
            T_ct_us * us_from_scan(us.geometry, {static_cast<double>(s), static_cast<double>(l),
                                                 static_cast<double>(f)}));
        if (rho > 0.82 && rho < 0.95) {
          cortex += us.at(s, l, f);
          ++cortex_count;
        } else if (rho > 1.1 && rho < 1.3) {
          fat += us.at(s, l, f);
          ++fat_count;
        }
      }
  ASSERT_GT(cortex_count, 100);
  ASSERT_GT(fat_count, 100);
  EXPECT_GT(fat / fat_count, cortex / cortex_count + 10.0);
}

TEST(FromCt, VariationMovesTheEchoesAndNotTheCt) {
  const Input input = cylinder_body();
  PhantomOptions options;
  options.scene = SceneKind::kFromCt;
  options.from_ct = input.from_ct;
  options.sweep.samples = 60;
  options.sweep.lines = 20;
  options.sweep.frames = 4;
  options.sweep.lateral_fov_deg = 30.0;
  options.sweep.elevation_fov_deg = 4.0;
  const PhantomCase plain = make_phantom_from_ct(input.ct, input.labels, options);
  options.anatomy.tissue_variation = 1.0;
  const PhantomCase varied = make_phantom_from_ct(input.ct, input.labels, options);
  EXPECT_EQ(varied.ct.voxels, plain.ct.voxels);
  EXPECT_NE(varied.ultrasound.voxels, plain.ultrasound.voxels);
}

TEST(FromCt, SaysWhatIsMissing) {
  const Input input = cylinder_body();
  const auto make = [&](const FromCtOptions& from_ct, const LabelVolume& labels) {
    PhantomOptions options;
    options.scene = SceneKind::kFromCt;
    options.from_ct = from_ct;
    return [=, &input] { make_phantom_from_ct(input.ct, labels, options); };
  };
  FromCtOptions from_ct;
  usct::test::expect_input_error(make(from_ct, input.labels), {"kidney_label", "kidney_centre"});
  from_ct.kidney_label = 7;
  usct::test::expect_input_error(make(from_ct, input.labels), {"tissue_of_label", "7"});
  from_ct.tissue_of_label[7] = Tissue::kCortex;
  usct::test::expect_input_error(make(from_ct, {}), {"no label map"});
  from_ct.tissue_of_label[9] = Tissue::kLiver;
  usct::test::expect_input_error(make(from_ct, input.labels), {"label 9"});
  FromCtOptions point;
  point.kidney_centre_mm = Vector3d(9999, 0, 0);
  usct::test::expect_input_error(make(point, input.labels), {"label map", "none of it counts"});
  usct::test::expect_input_error(make(point, {}), {"outside the CT"});
  PhantomOptions options;
  options.scene = SceneKind::kFromCt;
  options.from_ct.kidney_centre_mm = Vector3d::Zero();
  CtVolume air = input.ct;
  std::fill(air.voxels.begin(), air.voxels.end(), static_cast<std::int16_t>(-1000));
  usct::test::expect_input_error([&] { make_phantom_from_ct(air, {}, options); }, {"no body"});
}

TEST(FromCt, ARealPatientsKidneyIsSeenFromOutside) {
  const auto folder = usct::test::data_root() / "totalseg_ct";
  USCT_REQUIRE_DATA(folder);
  const auto ct = read_volume<std::int16_t>(folder / "example_ct.nii.gz");
  for (const char* side : {"left", "right"}) {
    const auto labels =
        read_volume<std::uint16_t>(folder / ("example_ct_kidney_" + std::string(side) + ".nii.gz"));
    FromCtOptions from_ct;
    from_ct.tissue_of_label[1] = Tissue::kCortex;
    from_ct.kidney_label = 1;
    const Scene scene = make_ct_scene(1, ct, labels, from_ct, {});
    const Vector3d contact = scene.T_ct_probe.translation();
    EXPECT_EQ(scene.anatomy->tissue(contact), Tissue::kAir);
    const Vector3d on_surface = scene.kidney_surface_ct_mm[200];
    const Tissue below =
        scene.anatomy->tissue(on_surface + 0.1 * (scene.kidney_centre_ct_mm - on_surface));
    EXPECT_TRUE(below == Tissue::kCortex || below == Tissue::kMedulla);
    // Most of the kidney is reached without meeting bone or gas.
    int reached = 0;
    for (const Vector3d& target : scene.kidney_surface_ct_mm) {
      bool blocked = false;
      for (double t = 0.02; t < 0.98 && !blocked; t += 0.01) {
        const Tissue tissue = scene.anatomy->tissue(contact + t * (target - contact));
        blocked = tissue != Tissue::kAir && is_strong_reflector(tissue);
      }
      reached += blocked ? 0 : 1;
    }
    EXPECT_GT(reached, kTargetCount / 2) << side;
  }
}

}  // namespace
}  // namespace usct::phantom::test
