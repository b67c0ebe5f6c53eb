#include <gtest/gtest.h>

#include <cmath>

#include "core/phantom/simple_scenes.h"
#include "phantom/scenes.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/phantom/ct_formation.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::phantom::test {
namespace {

CtVolume ct_of(const Scene& scene, const CtOptions& options, std::uint64_t seed = 1) {
  const Grid grid = ct_grid(options, scene.ct_centre_mm);
  return form_ct(*scene.anatomy, scene.tissues, form_labels(*scene.anatomy, grid), options, seed);
}

CtOptions small_ct() {
  CtOptions options;
  options.size = {96, 80, 44};
  options.noise_hu = 0.0;
  return options;
}

const Scene& patient() {
  static const Scene scene = make_patient_scene(4, {});
  return scene;
}

float at(const CtVolume& ct, const Eigen::Vector3d& p) {
  return sample(ct, p, Interpolation::kTrilinear, Outside::edge());
}

class StorageOrder : public testing::TestWithParam<std::string> {};

/// The storage order of the grid must not move the patient.
TEST_P(StorageOrder, ShowsTheSamePatient) {
  const CtVolume reference = ct_of(patient(), small_ct());
  CtOptions options = small_ct();
  options.axes = GetParam();
  const CtVolume ct = ct_of(patient(), options);
  ASSERT_EQ(ct.voxels.size(), reference.voxels.size());
  double largest = 0.0;
  for (int k = 0; k < ct.grid.size.z(); ++k)
    for (int j = 0; j < ct.grid.size.y(); ++j)
      for (int i = 0; i < ct.grid.size.x(); ++i) {
        const Eigen::Vector3d p = ct.grid.physical_from_index(Eigen::Vector3d(i, j, k));
        const Eigen::Vector3d index = reference.grid.index_from_physical(p).array().round();
        const float expected =
            sample_at_index(reference, index, Interpolation::kNearest, Outside::constant(-9999.0F));
        largest = std::max(
            largest, std::abs(static_cast<double>(static_cast<float>(ct.at(i, j, k)) - expected)));
      }
  // By rounding, some supersampling points fall on the other side of a boundary.
  EXPECT_LE(largest, 40.0);
}
INSTANTIATE_TEST_SUITE_P(CtFormation, StorageOrder, testing::Values("RAS", "SPL", "PIR", "IRA"));

TEST(CtFormation, AnObliqueGridShowsTheSamePatient) {
  const CtVolume reference = ct_of(patient(), small_ct());
  CtOptions options = small_ct();
  options.axes = "SRP";
  options.oblique_deg = {12.0, -8.0, 20.0};
  const CtVolume ct = ct_of(patient(), options);
  EXPECT_GT((ct.grid.direction - reference.grid.direction).norm(), 0.3);
  // Points throughout the middle, on neither of the two grids.
  double squares = 0.0;
  double variance = 0.0;
  double mean = 0.0;
  int count = 0;
  std::vector<double> values;
  for (double x = -12.0; x <= 12.0; x += 1.1)
    for (double y = -10.0; y <= 10.0; y += 1.1)
      for (double z = -12.0; z <= 12.0; z += 1.1, ++count) {
        const Eigen::Vector3d p = patient().ct_centre_mm + Eigen::Vector3d(x, y, z);
        const double expected = static_cast<double>(at(reference, p));
        squares += std::pow(static_cast<double>(at(ct, p)) - expected, 2);
        values.push_back(expected);
        mean += expected;
      }
  mean /= count;
  for (const double v : values) variance += (v - mean) * (v - mean);
  // Two trilinear readings of one blurred field differ at sharp edges only.
  EXPECT_LT(squares / variance, 0.02);
}

TEST(CtFormation, TissueHasItsHounsfieldUnits) {
  Scene scene = homogeneous_scene(Tissue::kLiver);
  scene.tissues[Tissue::kLiver].hu_texture = 0.0;
  CtOptions options = small_ct();
  options.size = {12, 12, 8};
  for (const std::int16_t v : ct_of(scene, options).voxels)
    ASSERT_EQ(v, static_cast<std::int16_t>(scene.tissues[Tissue::kLiver].hu));
}

TEST(CtFormation, AHalfFilledVoxelIsHalfWay) {
  // The boundary passes through the middle of a voxel: partial volume, not a step.
  Scene scene = simple_scene(
      [](const Eigen::Vector3d& p) { return p.x() < 0.0 ? Tissue::kAgar : Tissue::kPlastic; });
  scene.tissues[Tissue::kAgar].hu = 0.0;
  scene.tissues[Tissue::kPlastic].hu = 100.0;
  for (const Tissue t : {Tissue::kAgar, Tissue::kPlastic}) scene.tissues[t].hu_texture = 0.0;
  CtOptions options = small_ct();
  options.size = {11, 11, 5};
  options.in_plane_fwhm_mm = 0.0;
  options.slice_fwhm_mm = 0.0;
  const CtVolume ct = ct_of(scene, options);
  EXPECT_EQ(ct.at(4, 5, 2), 0);
  EXPECT_NEAR(ct.at(5, 5, 2), 50.0, 17.0);  // three sub-samples per axis
  EXPECT_EQ(ct.at(6, 5, 2), 100);
}

TEST(CtFormation, PointSpreadHasTheWidthAskedFor) {
  // An edge blurred by a Gaussian rises from 12 % to 88 % within the full width at half maximum.
  Scene scene = simple_scene(
      [](const Eigen::Vector3d& p) { return p.x() < 0.0 ? Tissue::kAgar : Tissue::kPlastic; });
  scene.tissues[Tissue::kAgar].hu = 0.0;
  scene.tissues[Tissue::kPlastic].hu = 1000.0;
  for (const Tissue t : {Tissue::kAgar, Tissue::kPlastic}) scene.tissues[t].hu_texture = 0.0;
  CtOptions options = small_ct();
  options.size = {81, 9, 5};
  options.spacing_mm = {0.1, 0.468, 1.0};
  options.in_plane_fwhm_mm = 1.2;
  const CtVolume ct = ct_of(scene, options);
  const auto crossing_mm = [&](double level) {
    for (int i = 1; i < ct.grid.size.x(); ++i)
      if (ct.at(i, 4, 2) >= level)
        return 0.1 * (i - (ct.at(i, 4, 2) - level) / (ct.at(i, 4, 2) - ct.at(i - 1, 4, 2)));
    return 0.0;
  };
  // erf(sqrt(ln 2)) = 0.7610: half of the rise is on either side of the middle.
  EXPECT_NEAR(crossing_mm(880.5) - crossing_mm(119.5), 1.2, 0.06);
}

TEST(CtFormation, NoiseHasTheSizeAskedForAndIsCorrelated) {
  Scene scene = homogeneous_scene(Tissue::kLiver);
  scene.tissues[Tissue::kLiver].hu_texture = 0.0;
  CtOptions options = small_ct();
  options.noise_hu = 20.0;
  const CtVolume ct = ct_of(scene, options);
  const double mean = scene.tissues[Tissue::kLiver].hu;
  double squares = 0.0;
  double neighbours = 0.0;
  for (int k = 0; k < ct.grid.size.z(); ++k)
    for (int j = 0; j < ct.grid.size.y(); ++j)
      for (int i = 0; i + 1 < ct.grid.size.x(); ++i) {
        squares += std::pow(ct.at(i, j, k) - mean, 2);
        neighbours += (ct.at(i, j, k) - mean) * (ct.at(i + 1, j, k) - mean);
      }
  const double count = (ct.grid.size.x() - 1.0) * ct.grid.size.y() * ct.grid.size.z();
  EXPECT_NEAR(std::sqrt(squares / count), 20.0, 1.0);
  EXPECT_GT(neighbours / squares, 0.3);
}

TEST(CtFormation, ASteelBallSmallerThanAVoxelIsSeen) {
  Scene scene = simple_scene([](const Eigen::Vector3d&) { return Tissue::kAgar; },
                             {{{0.2, 0.1, 0.45}, 0.5, Tissue::kSteel}});
  CtOptions options = small_ct();
  options.size = {21, 21, 11};
  const CtVolume ct = ct_of(scene, options);
  EXPECT_GT(*std::max_element(ct.voxels.begin(), ct.voxels.end()), 300);
}

TEST(CtFormation, RefusesAxesThatAreNoOrientation) {
  CtOptions options = small_ct();
  for (const char* axes : {"", "LP", "LPP", "LRS", "XYZ", "LPSS"}) {
    options.axes = axes;
    EXPECT_THROW(options.validate(), InputError) << axes;
  }
}

}  // namespace
}  // namespace usct::phantom::test
