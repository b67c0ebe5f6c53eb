#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "core/io/expect_input_error.h"
#include "phantom/scenes.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/phantom/phantom.h"
#include "us_ct_registration/threads.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::phantom::test {
namespace {

using Eigen::Vector3d;

/// A case that takes about a second.
PhantomOptions small_case(SceneKind scene, std::uint64_t seed) {
  PhantomOptions options;
  options.scene = scene;
  options.seed = seed;
  options.ct.size = {70, 50, 36};
  options.ct.spacing_mm = {2.0, 2.0, 3.0};
  options.sweep.samples = 100;
  options.sweep.lines = 32;
  options.sweep.frames = 12;
  options.sweep.lateral_fov_deg = 24.0;
  options.sweep.elevation_fov_deg = 8.0;
  options.sweep.depth_mm = 70.0;
  return options;
}

PhantomCase make_with_threads(const PhantomOptions& options, int threads) {
  const ThreadCount scope(threads);
  return make_phantom(options);
}

class EveryScene : public testing::TestWithParam<SceneKind> {};

TEST_P(EveryScene, SameSeedGivesTheSameBitsWithAnyNumberOfThreads) {
  const PhantomOptions options = small_case(GetParam(), 11);
  const PhantomCase one = make_with_threads(options, 1);
  const PhantomCase two = make_with_threads(options, 3);
  EXPECT_EQ(one.ct.voxels, two.ct.voxels);
  EXPECT_EQ(one.labels.voxels, two.labels.voxels);
  EXPECT_EQ(one.ultrasound.voxels, two.ultrasound.voxels);
  EXPECT_EQ(describe_json(one), describe_json(two));
  PhantomOptions other = options;
  other.seed = 12;
  const PhantomCase different = make_phantom(other);
  EXPECT_NE(one.ct.voxels, different.ct.voxels);
  EXPECT_NE(one.ultrasound.voxels, different.ultrasound.voxels);
  EXPECT_FALSE(one.truth.T_us_ct.isApprox(different.truth.T_us_ct, 1e-3));
}

TEST_P(EveryScene, KidneyIsInViewAndPoseIsNotTheIdentity) {
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    const Scene scene =
        GetParam() == SceneKind::kAgar ? make_agar_scene(seed, {}) : make_patient_scene(seed, {});
    const Acquisition acquisition =
        make_acquisition({}, scene.suggested_depth_mm, scene.surface_radius_mm, seed);
    const Eigen::Isometry3d T_us_ct = acquisition.T_us_probe * scene.T_ct_probe.inverse();
    EXPECT_GT(T_us_ct.translation().norm(), 20.0);
    const ScanGeometry& geometry = acquisition.recorded;
    const MotorisedInverse inverse(geometry);
    int seen = 0;
    for (const Vector3d& p : scene.kidney_surface_ct_mm) {
      const ScanIndex i = inverse.scan_from_us(T_us_ct * p);
      seen += i.sample >= 0 && i.sample < geometry.samples() && i.line >= 0 &&
                      i.line < geometry.lines() && i.frame >= 0 && i.frame < geometry.frames()
                  ? 1
                  : 0;
    }
    EXPECT_GT(seen, 0.85 * static_cast<double>(scene.kidney_surface_ct_mm.size()))
        << "seed " << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(Phantom, EveryScene,
                         testing::Values(SceneKind::kAgar, SceneKind::kPatient),
                         [](const auto& scene) { return to_string(scene.param); });

struct Spot {
  Vector3d position;
  double weight;
};

/// Centroids of groups of bright points that are less than 4 mm apart, brightest group first.
std::vector<Spot> cluster(std::vector<Spot> points) {
  std::sort(points.begin(), points.end(),
            [](const Spot& a, const Spot& b) { return a.weight > b.weight; });
  std::vector<Spot> groups;
  std::vector<Vector3d> first;
  for (const Spot& p : points) {
    std::size_t g = 0;
    while (g < groups.size() && (first[g] - p.position).norm() > 4.0) ++g;
    if (g == groups.size()) {
      groups.push_back({Vector3d::Zero(), 0.0});
      first.push_back(p.position);
    }
    groups[g].position += p.weight * p.position;
    groups[g].weight += p.weight;
  }
  for (Spot& g : groups) g.position /= g.weight;
  return groups;
}

/// The balls found in each image, without use of the truth, coincide under the truth.
TEST(AgarPhantom, SteelBallsOfBothImagesCoincideUnderTheTruth) {
  PhantomOptions options;
  options.seed = 8;
  options.ct.size = {170, 220, 80};
  options.sweep.depth_mm = 44.0;  // the kidney is below
  options.anatomy.bubbles = 0;
  const PhantomCase phantom = make_phantom(options);

  // CT: far brighter than agar, above the kidney (anterior of it).
  double kidney_top = 1e9;
  const Grid& grid = phantom.ct.grid;
  std::vector<Spot> bright;
  for (int pass = 0; pass < 2; ++pass)
    for (int k = 0; k < grid.size.z(); ++k)
      for (int j = 0; j < grid.size.y(); ++j)
        for (int i = 0; i < grid.size.x(); ++i) {
          const Vector3d p = grid.physical_from_index(Vector3d(i, j, k));
          const bool cortex =
              phantom.labels.at(i, j, k) == static_cast<std::uint16_t>(Tissue::kCortex);
          if (pass == 0 && cortex) kidney_top = std::min(kidney_top, p.y());
          const double hu = phantom.ct.at(i, j, k);
          if (pass == 1 && p.y() < kidney_top - 2.0 && hu > 150.0) bright.push_back({p, hu});
        }
  const std::vector<Spot> in_ct = cluster(bright);
  ASSERT_EQ(in_ct.size(), 4U);

  // Ultrasound: the brightest spots between the near field and the kidney.
  const PreScanVolume& us = phantom.ultrasound;
  const BeamGrid beams = beam_grid(us.geometry);
  std::vector<Spot> echoes;
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l)
      for (int s = 0; s < beams.samples(); ++s)
        if (us.geometry.axial.depth_mm(s) > 15.0 && us.geometry.axial.depth_mm(s) < 43.0 &&
            us.at(s, l, f) > 160)
          echoes.push_back({beams.point(f, l, s), std::pow(10.0, us.at(s, l, f) / 40.0)});
  std::vector<Spot> in_us = cluster(echoes);
  ASSERT_GE(in_us.size(), 4U);
  in_us.resize(4);

  std::set<std::size_t> matched;
  for (const Spot& ball : in_ct) {
    const Vector3d expected = phantom.truth.T_us_ct * ball.position;
    std::size_t nearest = 0;
    for (std::size_t i = 1; i < in_us.size(); ++i)
      if ((in_us[i].position - expected).norm() < (in_us[nearest].position - expected).norm())
        nearest = i;
    EXPECT_LT((in_us[nearest].position - expected).norm(), 1.0);
    matched.insert(nearest);
  }
  EXPECT_EQ(matched.size(), 4U);
}

/// The kidney's border in each image, found by shifting the target surface in and out, must agree
/// with the truth.
TEST(AgarPhantom, KidneySurfaceOfBothImagesLiesAtTheTargets) {
  PhantomOptions options;
  options.seed = 3;
  options.ct.size = {150, 110, 110};
  options.ct.spacing_mm = {1.0, 1.0, 1.0};
  options.anatomy.bubbles = 0;
  options.sweep.lines = 80;
  options.sweep.lateral_fov_deg = 60.0;
  options.sweep.frames = 41;
  options.sweep.elevation_fov_deg = 36.0;
  options.sweep.depth_mm = 75.0;
  options.ultrasound.specular = 0.0;  // the border is then a plain step
  const PhantomCase phantom = make_phantom(options);
  const auto& us = phantom.ultrasound;
  const MotorisedInverse inverse(us.geometry);
  const Vector3d centre_us =
      phantom.truth.T_us_ct *
      Vector3d(std::accumulate(phantom.truth.targets_ct_mm.begin(),
                               phantom.truth.targets_ct_mm.end(), Vector3d(0, 0, 0)) /
               static_cast<double>(phantom.truth.targets_ct_mm.size()));
  const Eigen::Isometry3d T_ct_us = phantom.truth.T_us_ct.inverse();
  const auto us_at = [&](const Vector3d& p) {
    const ScanIndex i = inverse.scan_from_us(p);
    const int s = static_cast<int>(std::lround(i.sample));
    const int l = static_cast<int>(std::lround(i.line));
    const int f = static_cast<int>(std::lround(i.frame));
    if (s < 0 || s >= us.geometry.samples() || l < 0 || l >= us.geometry.lines() || f < 0 ||
        f >= us.geometry.frames())
      return -1.0;
    return static_cast<double>(us.at(s, l, f));
  };
  // Mean brightness at shifts of -6..6 mm along the ray from the kidney's middle, targets on the
  // side of the probe, away from the hilum's vessels.
  const auto edge_mm = [&](const std::function<double(const Vector3d&)>& value) {
    std::vector<double> profile(25, 0.0);
    for (const Vector3d& target : phantom.truth.targets_us_mm) {
      const Vector3d outwards = (target - centre_us).normalized();
      if (outwards.y() > -0.6) continue;
      for (int i = 0; i < 25; ++i)
        profile[static_cast<std::size_t>(i)] += value(target + 0.5 * (i - 12) * outwards);
    }
    // The border is half way between the means well inside and well outside.
    const double inside = (profile[0] + profile[1] + profile[2] + profile[3]) / 4.0;
    const double outside = (profile[21] + profile[22] + profile[23] + profile[24]) / 4.0;
    EXPECT_GT(inside, 1.3 * outside);
    const double half = 0.5 * (inside + outside);
    int i = 3;
    while (i < 23 && profile[static_cast<std::size_t>(i)] > half) ++i;
    const double before = profile[static_cast<std::size_t>(i - 1)];
    const double after = profile[static_cast<std::size_t>(i)];
    return 0.5 * (i - 12 - (half - after) / (before - after));
  };
  const double in_us = edge_mm(us_at);
  const double in_ct = edge_mm([&](const Vector3d& p) {
    return 1000.0 +
           static_cast<double>(sample(phantom.ct, Vector3d(T_ct_us * p), Interpolation::kTrilinear,
                                      Outside::edge())) -
           900.0;
  });
  EXPECT_NEAR(in_us, 0.0, 0.7);
  EXPECT_NEAR(in_ct, 0.0, 0.4);
}

TEST(PatientPhantom, HoldsWhatAScanOfAPatientShows) {
  const Scene scene = make_patient_scene(2, {});
  CtOptions options;
  options.size = {200, 150, 90};  // all of the torso
  options.spacing_mm = {2.0, 2.0, 3.0};
  std::vector<int> voxels(kTissueCount, 0);
  for (const std::uint16_t label :
       form_labels(*scene.anatomy, ct_grid(options, scene.ct_centre_mm)).voxels)
    ++voxels[label];
  const auto count = [&](Tissue t) { return voxels[static_cast<std::size_t>(t)]; };
  for (const Tissue t :
       {Tissue::kSkin, Tissue::kSubcutaneousFat, Tissue::kFascia, Tissue::kMuscle,
        Tissue::kPerirenalFat, Tissue::kSinusFat, Tissue::kCortex, Tissue::kMedulla,
        Tissue::kArtery, Tissue::kVein, Tissue::kUrine, Tissue::kTumour, Tissue::kCyst,
        Tissue::kStone, Tissue::kCorticalBone, Tissue::kSpongyBone, Tissue::kGas, Tissue::kBowel})
    EXPECT_GT(count(t), 0) << static_cast<int>(t);
  EXPECT_GT(count(Tissue::kLiver) + count(Tissue::kSpleen), 1000);
  // A kidney of an adult: 100-250 ml, voxels of 12 mm^3.
  const double kidney_ml =
      0.012 * (count(Tissue::kCortex) + count(Tissue::kMedulla) + count(Tissue::kSinusFat));
  EXPECT_GT(kidney_ml, 80.0);
  EXPECT_LT(kidney_ml, 260.0);
}

TEST(Deformation, MovesTheKidneyByTheAmountAskedForAndTruthIsTheBestRigidFit) {
  PhantomOptions options = small_case(SceneKind::kPatient, 5);
  options.ct.size = {8, 8, 8};
  options.sweep.depth_mm = 20.0;
  options.anatomy.indentation_mm = 0.0;
  const PhantomTruth rigid = make_phantom(options).truth;
  EXPECT_LT(rigid.max_residual_mm, 1e-9);
  options.anatomy.deformation_mm = 6.0;
  const PhantomTruth truth = make_phantom(options).truth;
  double largest = 0.0;
  for (std::size_t i = 0; i < truth.targets_us_mm.size(); ++i)
    largest = std::max(largest, (truth.targets_us_mm[i] - rigid.targets_us_mm[i]).norm());
  EXPECT_NEAR(largest, 6.0, 1e-6);
  EXPECT_GT(truth.rms_residual_mm, 0.3);
  EXPECT_LE(truth.rms_residual_mm, truth.max_residual_mm);
  // No small motion of the truth fits better.
  const auto rms = [&](const Eigen::Isometry3d& T) {
    double squares = 0.0;
    for (std::size_t i = 0; i < truth.targets_us_mm.size(); ++i)
      squares += (T * truth.targets_ct_mm[i] - truth.targets_us_mm[i]).squaredNorm();
    return std::sqrt(squares / static_cast<double>(truth.targets_us_mm.size()));
  };
  EXPECT_NEAR(rms(truth.T_us_ct), truth.rms_residual_mm, 1e-9);
  for (int axis = 0; axis < 3; ++axis)
    for (const double step : {-0.01, 0.01}) {
      const Vector3d unit = Vector3d::Unit(axis);
      EXPECT_GT(rms(Eigen::Translation3d(step * unit) * truth.T_us_ct), truth.rms_residual_mm);
      EXPECT_GT(
          rms(truth.T_us_ct * Eigen::Translation3d(truth.targets_ct_mm[0]) *
              Eigen::AngleAxisd(0.1 * step, unit) * Eigen::Translation3d(-truth.targets_ct_mm[0])),
          truth.rms_residual_mm);
    }
}

TEST(Indentation, PressesTheNearTissueMoreThanTheKidney) {
  PhantomOptions options = small_case(SceneKind::kPatient, 5);
  options.ct.size = {8, 8, 8};
  options.sweep.depth_mm = 20.0;
  options.anatomy.indentation_mm = 8.0;
  const PhantomTruth truth = make_phantom(options).truth;
  EXPECT_GT(truth.max_residual_mm, 0.1);
  EXPECT_LT(truth.max_residual_mm, 8.0);
}

TEST(TrackedPhantom, RecordsPosesTimesAndGoesWithTheTruth) {
  for (const SweepKind kind : {SweepKind::kTrackedCurvilinear, SweepKind::kTrackedLinear}) {
    PhantomOptions options = small_case(SceneKind::kAgar, 4);
    options.sweep.kind = kind;
    options.sweep.elevation_fov_deg.reset();
    options.sweep.frames = 20;
    options.sweep.sweep_length_mm = 30.0;
    const PhantomCase phantom = make_phantom(options);
    const auto& recorded = std::get<TrackedSweep>(phantom.ultrasound.geometry.motion);
    const auto& truth = std::get<TrackedSweep>(phantom.truth.geometry.motion);
    ASSERT_EQ(recorded.T_us_frame.size(), 20U);
    ASSERT_EQ(recorded.frame_times_s.size(), 20U);
    for (std::size_t f = 0; f < 20; ++f)
      EXPECT_TRUE(recorded.T_us_frame[f].isApprox(truth.T_us_frame[f], 1e-12));
    // The kidney lies below the middle frame.
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& p : phantom.truth.targets_us_mm) centre += p / 400.0;
    const Vector3d in_frame = recorded.T_us_frame[10].inverse() * centre;
    EXPECT_LT(std::abs(in_frame.x()), 25.0);
    EXPECT_LT(std::abs(in_frame.z()), 25.0);
  }
}

TEST(Knobs, OutOfRangeAreNamedWithValueAndRange) {
  using Change = std::function<void(PhantomOptions&)>;
  const std::vector<std::pair<Change, std::vector<std::string>>> cases = {
      {[](auto& o) { o.anatomy.contrast = 0.0; }, {"contrast", "0", "[0.01, 1.5]"}},
      {[](auto& o) { o.anatomy.contrast = std::nan(""); }, {"contrast", "nan"}},
      {[](auto& o) { o.anatomy.tissue_variation = 2.1; }, {"tissue_variation", "2.1", "[0, 2]"}},
      {[](auto& o) { o.anatomy.bubbles = -1; }, {"bubbles", "-1"}},
      {[](auto& o) { o.anatomy.deformation_mm = 16.0; }, {"deformation_mm", "16"}},
      {[](auto& o) { o.anatomy.standoff_mm = 31.0; }, {"standoff_mm"}},
      {[](auto& o) { o.anatomy.indentation_mm = -1.0; }, {"indentation_mm"}},
      {[](auto& o) { o.ct.size.x() = 1; }, {"ct.size[0]"}},
      {[](auto& o) { o.ct.spacing_mm.z() = 0.0; }, {"ct.spacing_mm[2]"}},
      {[](auto& o) { o.ct.noise_hu = -1.0; }, {"ct.noise_hu"}},
      {[](auto& o) { o.sweep.samples = 3; }, {"samples", "3"}},
      {[](auto& o) { o.sweep.lines = 0; }, {"lines"}},
      {[](auto& o) { o.sweep.depth_mm = 2.0; }, {"depth_mm"}},
      {[](auto& o) { o.sweep.lateral_fov_deg = 180.0; }, {"lateral_fov_deg"}},
      {[](auto& o) { o.sweep.elevation_fov_deg = 0.0; }, {"elevation_fov_deg"}},
      {[](auto& o) { o.sweep.sweep_error = 2.1; }, {"sweep_error"}},
      {[](auto& o) { o.sweep.lag_s = 0.5; }, {"lag_s", "tracked"}},
      {[](auto& o) { o.sweep.duplicate_fraction = 0.1; }, {"duplicate_fraction", "tracked"}},
      {[](auto& o) { o.sweep.breathing_mm = 31.0; }, {"breathing_mm", "31"}},
      {[](auto& o) { o.sweep.breathing_period_s = 0.0; }, {"breathing_period_s"}},
      {[](auto& o) { o.sweep.sweep_duration_s = 0.0; }, {"sweep_duration_s"}},
      {[](auto& o) {
         o.sweep.kind = SweepKind::kTrackedLinear;
         o.sweep.sweep_duration_s = 2.0;
       },
       {"sweep_duration_s", "motorised"}},
      {[](auto& o) {
         o.sweep.kind = SweepKind::kTrackedLinear;
         o.sweep.sweep_error = 1.0;
       },
       {"sweep_error", "motorised"}},
      {[](auto& o) { o.ultrasound.dynamic_range_db = 10.0; }, {"dynamic_range_db"}},
      {[](auto& o) { o.ultrasound.penetration_mm = 0.0; }, {"penetration_mm"}},
      {[](auto& o) { o.ultrasound.sound_speed_error = 0.2; }, {"sound_speed_error"}},
      {[](auto& o) { o.ultrasound.echo_texture_db = 13.0; }, {"echo_texture_db", "13"}},
      {[](auto& o) { o.ultrasound.edge_shadows = -0.1; }, {"edge_shadows"}},
      {[](auto& o) { o.ultrasound.no_contact_lines = 65; }, {"no_contact_lines", "64"}},
      {[](auto& o) { o.from_ct.bone_hu = 0.0; }, {"bone_hu"}},
      {[](auto& o) { o.scene = SceneKind::kFromCt; }, {"scene", "CT"}},
  };
  for (const auto& [change, named] : cases) {
    PhantomOptions options;
    change(options);
    usct::test::expect_input_error([&] { make_phantom(options); }, named);
  }
  usct::test::expect_input_error([] { parse_scene("pig", "--scene"); }, {"--scene", "pig"});
  usct::test::expect_input_error([] { parse_sweep("freehand", "--sweep"); }, {"freehand"});
  usct::test::expect_input_error([] { parse_tissue("bacon", "--label"); }, {"bacon", "cortex"});
}

TEST(Knobs, ContrastScalesDifferencesOfSoftTissueOnly) {
  const TissueTable full = TissueTable::patient();
  const TissueTable weak = full.with_contrast(0.4);
  const double cortex_hu = full[Tissue::kCortex].hu;
  EXPECT_NEAR(weak[Tissue::kFat].hu - cortex_hu, 0.4 * (full[Tissue::kFat].hu - cortex_hu), 1e-9);
  EXPECT_NEAR(weak[Tissue::kMedulla].echogenicity_db, 0.4 * full[Tissue::kMedulla].echogenicity_db,
              1e-9);
  for (const Tissue t : {Tissue::kCorticalBone, Tissue::kGas, Tissue::kAir, Tissue::kStone})
    EXPECT_EQ(weak[t].hu, full[t].hu);
}

TEST(Description, HoldsEveryOptionAndTheTruth) {
  PhantomOptions options = small_case(SceneKind::kAgar, 21);
  options.sweep.sweep_error = 1.0;
  options.ct.size = {8, 8, 8};
  const PhantomCase phantom = make_phantom(options);
  const auto json = nlohmann::json::parse(describe_json(phantom));
  EXPECT_EQ(json["seed"], 21);
  EXPECT_EQ(json["scene"], "agar");
  EXPECT_EQ(json["options"]["sweep"]["sweep_error"], 1.0);
  EXPECT_EQ(json["labels"]["12"], "cortex");
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c)
      EXPECT_EQ(json["truth"]["T_us_ct"][static_cast<std::size_t>(4 * r + c)],
                phantom.truth.T_us_ct.matrix()(r, c));
  // First frame: recorded -4 degrees, slow half of the thesis' probe.
  EXPECT_NEAR(json["truth"]["geometry"]["frame_angles_deg"][0], -4.0 * 0.611 / 0.731, 1e-9);
}

}  // namespace
}  // namespace usct::phantom::test
