#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/phantom/simple_scenes.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom::test {
namespace {

using Eigen::Vector3d;

/// Bone, gas, stone, steel, plastic and air, which no variation changes.
bool is_fixed(Tissue t) {
  return is_strong_reflector(t) || t == Tissue::kPlastic || t == Tissue::kAir;
}

double mean(const std::vector<double>& v) {
  double sum = 0.0;
  for (const double x : v) sum += x;
  return sum / static_cast<double>(v.size());
}

double covariance(const std::vector<double>& a, const std::vector<double>& b) {
  const double mean_a = mean(a);
  const double mean_b = mean(b);
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - mean_a) * (b[i] - mean_b);
  return sum / static_cast<double>(a.size());
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  return covariance(a, b) / std::sqrt(covariance(a, a) * covariance(b, b));
}

/// A case that takes about a second.
PhantomOptions small_patient() {
  PhantomOptions options;
  options.scene = SceneKind::kPatient;
  options.seed = 9;
  options.ct.size = {70, 50, 36};
  options.ct.spacing_mm = {2.0, 2.0, 3.0};
  options.sweep.samples = 80;
  options.sweep.lines = 24;
  options.sweep.frames = 8;
  options.sweep.lateral_fov_deg = 24.0;
  options.sweep.elevation_fov_deg = 8.0;
  options.sweep.depth_mm = 70.0;
  return options;
}

TEST(TissueVariation, OfZeroChangesNothing) {
  const TissueTable table = TissueTable::patient();
  const TissueTable same = table.with_variation(0.0, 7);
  for (int i = 0; i < kTissueCount; ++i) {
    const auto t = static_cast<Tissue>(i);
    EXPECT_EQ(same[t].hu, table[t].hu);
    EXPECT_EQ(same[t].echogenicity_db, table[t].echogenicity_db);
  }
}

TEST(TissueVariation, MovesEachSoftTissueByItsOwnClampedNormalDraws) {
  const TissueTable table = TissueTable::ex_vivo();
  constexpr double kFactor = 1.5;
  constexpr int kSeeds = 400;
  std::vector<std::vector<double>> db(kTissueCount);
  std::vector<std::vector<double>> hu(kTissueCount);
  std::vector<double> all_db;
  std::vector<double> all_hu;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const TissueTable varied = table.with_variation(kFactor, seed);
    for (int i = 0; i < kTissueCount; ++i) {
      const auto t = static_cast<Tissue>(i);
      const auto n = static_cast<std::size_t>(i);
      db[n].push_back((varied[t].echogenicity_db - table[t].echogenicity_db) / (5.0 * kFactor));
      hu[n].push_back((varied[t].hu - table[t].hu) / (20.0 * kFactor));
      if (is_fixed(t)) {
        EXPECT_EQ(db[n].back(), 0.0);
        EXPECT_EQ(hu[n].back(), 0.0);
      } else {
        all_db.push_back(db[n].back());
        all_hu.push_back(hu[n].back());
      }
    }
  }
  // A standard normal number that is clamped at +-2 has the variance
  // erf(sqrt(2)) - 4 phi(2) + 4 erfc(sqrt(2)), with the density phi.
  const double phi = std::exp(-2.0) / std::sqrt(2.0 * kPi);
  const double variance = std::erf(std::sqrt(2.0)) - 4.0 * phi + 4.0 * std::erfc(std::sqrt(2.0));
  for (const std::vector<double>& draws : {all_db, all_hu}) {
    EXPECT_NEAR(mean(draws), 0.0, 0.04);
    EXPECT_NEAR(covariance(draws, draws), variance, 0.05);
    EXPECT_NEAR(*std::max_element(draws.begin(), draws.end()), 2.0, 1e-9);
    EXPECT_NEAR(*std::min_element(draws.begin(), draws.end()), -2.0, 1e-9);
  }
  // 400 independent pairs have a correlation of 0 +- 0.05.
  const auto cortex = static_cast<std::size_t>(Tissue::kCortex);
  const auto fat = static_cast<std::size_t>(Tissue::kPerirenalFat);
  EXPECT_LT(std::abs(correlation(db[cortex], hu[cortex])), 0.2);
  EXPECT_LT(std::abs(correlation(db[cortex], db[fat])), 0.2);
  EXPECT_LT(std::abs(correlation(hu[cortex], hu[fat])), 0.2);
}

TEST(TissueVariation, ShowsInTheCtOfACase) {
  PhantomOptions options = small_patient();
  const PhantomCase plain = make_phantom(options);
  options.anatomy.tissue_variation = 2.0;
  const PhantomCase varied = make_phantom(options);
  const TissueTable table = TissueTable::patient();
  const TissueTable moved = table.with_variation(2.0, options.seed);
  for (const Tissue tissue : {Tissue::kMuscle, Tissue::kCortex, Tissue::kPerirenalFat}) {
    std::vector<double> shifts;
    const LabelVolume& labels = plain.labels;
    for (int k = 1; k + 1 < labels.grid.size.z(); ++k)
      for (int j = 1; j + 1 < labels.grid.size.y(); ++j)
        for (int i = 1; i + 1 < labels.grid.size.x(); ++i) {
          bool inside = true;
          for (int n = 0; n < 27; ++n)
            inside = inside && labels.at(i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1) ==
                                   static_cast<std::uint16_t>(tissue);
          if (inside) shifts.push_back(varied.ct.at(i, j, k) - plain.ct.at(i, j, k));
        }
    ASSERT_GT(shifts.size(), 10U);
    EXPECT_NEAR(mean(shifts), moved[tissue].hu - table[tissue].hu, 0.5);
  }
  EXPECT_NE(varied.ultrasound.voxels, plain.ultrasound.voxels);
}

TEST(EchoTexture, HasUnitVarianceAtBothLengthsAndOwnValuesInEachTissue) {
  std::vector<double> here;
  std::vector<double> elsewhere;
  std::vector<std::vector<double>> at_distance(3);
  const std::vector<double> distances_mm = {1.0, 5.0, 25.0};
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 30; ++j)
      for (int k = 0; k < 30; ++k) {
        const Vector3d p = 7.3 * Vector3d(i, j, k);
        here.push_back(echo_texture_at(Tissue::kCortex, p, 3));
        elsewhere.push_back(echo_texture_at(Tissue::kMedulla, p, 3));
        for (std::size_t d = 0; d < 3; ++d)
          at_distance[d].push_back(
              echo_texture_at(Tissue::kCortex, p + distances_mm[d] * Vector3d::UnitY(), 3));
      }
  EXPECT_NEAR(mean(here), 0.0, 0.05);
  EXPECT_NEAR(covariance(here, here), 1.0, 0.07);
  EXPECT_LT(std::abs(correlation(here, elsewhere)), 0.05);
  EXPECT_GT(correlation(here, at_distance[0]), 0.8);
  // At 5 mm only the coarser half is correlated.
  EXPECT_GT(correlation(here, at_distance[1]), 0.15);
  EXPECT_LT(correlation(here, at_distance[1]), 0.5);
  EXPECT_LT(std::abs(correlation(here, at_distance[2])), 0.05);
}

TEST(EchoTexture, BrightensTheEchoesByTheFieldOfTheTissueWhereverItLies) {
  // The anatomy is displaced and turned, so that a texture fixed to the probe would not fit.
  Placement placement;
  placement.T_probe_ct =
      Eigen::Translation3d(7.0, 4.0, -11.0) * Eigen::AngleAxisd(40.0 * kDegree, Vector3d::UnitX());
  const Scene scene = homogeneous_scene(Tissue::kCortex);
  UltrasoundOptions options = ideal_scanner();
  const Echoes plain = scan(scene, small_sweep(), 80.0, options, 5, placement);
  options.echo_texture_db = 6.0;
  const Echoes textured = scan(scene, small_sweep(), 80.0, options, 5, placement);
  const Acquisition acquisition = make_acquisition(small_sweep(), 80.0, 1e6, 5);
  const Eigen::Isometry3d T_ct_us = (acquisition.T_us_probe * placement.T_probe_ct).inverse();
  std::vector<double> field_db;
  std::vector<double> brighter_db;
  constexpr int kSamples = 4;  // of 0.4 mm
  for (int f = 0; f < plain.geometry.frames(); f += 2)
    for (int l = 2; l + 2 < plain.geometry.lines(); l += 3)
      for (int s = plain.sample_at(20.0); s + kSamples < plain.sample_at(60.0); s += kSamples) {
        double energy = 0.0;
        double textured_energy = 0.0;
        double field = 0.0;
        for (int i = s; i < s + kSamples; ++i) {
          energy += std::pow(plain.at(i, l, f), 2);
          textured_energy += std::pow(textured.at(i, l, f), 2);
          const Vector3d p_us = us_from_scan(plain.geometry, {1.0 * i, 1.0 * l, 1.0 * f});
          field += echo_texture_at(Tissue::kCortex, T_ct_us * p_us, 5) / kSamples;
        }
        field_db.push_back(6.0 * field);
        brighter_db.push_back(10.0 * std::log10(textured_energy / energy));
      }
  EXPECT_GT(correlation(field_db, brighter_db), 0.8);
  // The beam averages over some of the fine half of the texture.
  const double slope = covariance(field_db, brighter_db) / covariance(field_db, field_db);
  EXPECT_GT(slope, 0.75);
  EXPECT_LT(slope, 1.1);
}

TEST(EchoTexture, IsAbsentFromTheCt) {
  PhantomOptions options = small_patient();
  const PhantomCase plain = make_phantom(options);
  options.ultrasound.echo_texture_db = 6.0;
  const PhantomCase textured = make_phantom(options);
  EXPECT_EQ(textured.ct.voxels, plain.ct.voxels);
  EXPECT_NE(textured.ultrasound.voxels, plain.ultrasound.voxels);
  const auto json = nlohmann::json::parse(describe_json(textured));
  EXPECT_EQ(json["options"]["ultrasound"]["echo_texture_db"], 6.0);
}

/// The same scan without and with edge shadows.
class EdgeShadows {
 public:
  EdgeShadows(const Scene& scene, const SweepOptions& sweep) {
    UltrasoundOptions options = ideal_scanner();
    without_ = scan(scene, sweep, 80.0, options);
    options.edge_shadows = 1.0;
    with_ = scan(scene, sweep, 80.0, options);
  }
  /// How much darker a range of depths is on a line, over all frames.
  double loss_db(double from_mm, double to_mm, int line) const {
    const int first = without_.sample_at(from_mm);
    const int last = without_.sample_at(to_mm);
    return decibels(rms(without_, first, last, line, line) / rms(with_, first, last, line, line));
  }

 private:
  Echoes without_;
  Echoes with_;
};

TEST(EdgeShadow, GrowsWithTheTangentOfTheIncidenceOnAPlane) {
  const SweepOptions sweep = small_sweep();
  const auto loss = [&](double tilt_deg) {
    const Vector3d normal(std::sin(tilt_deg * kDegree), std::cos(tilt_deg * kDegree), 0.0);
    const Scene scene = simple_scene([=](const Vector3d& p) {
      return normal.dot(p - Vector3d(0.0, 40.0, 0.0)) < 0.0 ? Tissue::kPerirenalFat
                                                            : Tissue::kCortex;
    });
    return EdgeShadows(scene, sweep).loss_db(60.0, 75.0, sweep.lines / 2);
  };
  const double at_30 = loss(30.0);
  EXPECT_GT(at_30, 0.5);
  EXPECT_NEAR(loss(0.0), 0.0, 0.25 * at_30);
  EXPECT_NEAR(loss(55.0) / at_30, std::tan(55.0 * kDegree) / std::tan(30.0 * kDegree), 0.4);
}

/// A cylinder of 9 mm radius across the image plane, 35 mm deep.
Scene cylinder_scene(Tissue inside, Tissue outside) {
  return simple_scene(
      [=](const Vector3d& p) { return std::hypot(p.x(), p.y() - 35.0) < 9.0 ? inside : outside; });
}

TEST(EdgeShadow, FallsBelowTheSidesOfACystAndNowhereElse) {
  SweepOptions sweep = small_sweep();
  sweep.lines = 101;
  sweep.lateral_fov_deg = 40.0;
  sweep.frames = 3;
  sweep.elevation_fov_deg = 4.0;
  const int middle = sweep.lines / 2;
  // The lines come from 40 mm above the array's middle: the tangents of the cyst are at
  // asin(9 / (40 + 35)) on either side.
  const double tangent_deg = std::asin(9.0 / 75.0) / kDegree;
  const int aside = static_cast<int>(std::lround(tangent_deg / 0.4)) - 1;
  const auto darkest_db = [&](const EdgeShadows& shadows, int edge) {
    double darkest = 0.0;
    for (int line = edge - 2; line <= edge + 2; ++line)
      darkest = std::max(darkest, shadows.loss_db(55.0, 70.0, line));
    return darkest;
  };
  Scene scene = cylinder_scene(Tissue::kCyst, Tissue::kCortex);
  const EdgeShadows cyst(scene, sweep);
  for (const int edge : {middle - aside, middle + aside}) {
    EXPECT_GT(darkest_db(cyst, edge), 2.0);
    EXPECT_LT(cyst.loss_db(10.0, 20.0, edge), 0.2);
  }
  for (const int line : {middle - aside - 20, middle, middle + aside + 20})
    EXPECT_LT(cyst.loss_db(55.0, 70.0, line), 0.5);
  // A bend is proportional to the step of the logarithm of the speed.
  const EdgeShadows kidney(cylinder_scene(Tissue::kCortex, Tissue::kPerirenalFat), sweep);
  const auto speed = [&](Tissue t) { return scene.tissues[t].speed_m_s; };
  const double ratio = std::log(speed(Tissue::kCortex) / speed(Tissue::kPerirenalFat)) /
                       std::log(speed(Tissue::kCortex) / speed(Tissue::kCyst));
  EXPECT_NEAR(darkest_db(kidney, middle + aside) / darkest_db(cyst, middle + aside), ratio, 0.5);
  scene.tissues[Tissue::kCyst].speed_m_s = scene.tissues[Tissue::kCortex].speed_m_s;
  EXPECT_NEAR(darkest_db(EdgeShadows(scene, sweep), middle + aside), 0.0, 1e-9);
}

}  // namespace
}  // namespace usct::phantom::test
