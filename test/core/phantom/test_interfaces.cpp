#include <gtest/gtest.h>

#include <algorithm>

#include "core/phantom/simple_scenes.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom::test {
namespace {

/// Agar over fat, both without scatterers: the only echo is the interface's. The plane passes
/// (0, depth, 0), tilted about the elevation axis.
Scene plane_scene(double depth_mm, double tilt_deg) {
  const Eigen::Vector3d normal(std::sin(tilt_deg * kDegree), std::cos(tilt_deg * kDegree), 0.0);
  Scene scene = simple_scene([=](const Eigen::Vector3d& p) {
    return normal.dot(p - Eigen::Vector3d(0.0, depth_mm, 0.0)) < 0.0 ? Tissue::kAgar : Tissue::kFat;
  });
  scene.tissues[Tissue::kAgar].echogenicity_db = -300.0;
  scene.tissues[Tissue::kFat].echogenicity_db = -300.0;
  return scene;
}

/// Energy of the interface's echo along a line, mean over lines and frames, as an amplitude.
double interface_level(const Echoes& e, int first_line, int last_line) {
  double sum = 0.0;
  int count = 0;
  for (int f = 0; f < e.geometry.frames(); ++f)
    for (int l = first_line; l <= last_line; ++l, ++count)
      for (int s = 0; s < e.geometry.samples(); ++s) sum += std::pow(e.at(s, l, f), 2);
  return std::sqrt(sum / count);
}

/// Depth of the echo on a line: centroid of its intensity.
double echo_depth_mm(const Echoes& e, int line, int frame) {
  double sum = 0.0;
  double moment = 0.0;
  for (int s = 0; s < e.geometry.samples(); ++s) {
    const double intensity = std::pow(e.at(s, line, frame), 2);
    sum += intensity;
    moment += intensity * e.geometry.axial.depth_mm(s);
  }
  return moment / sum;
}

TEST(SpecularEcho, FallsWithTheAngleOfIncidence) {
  const SweepOptions sweep = small_sweep();
  const int middle = sweep.lines / 2;
  std::vector<double> levels_db;
  for (const double tilt : {0.0, 15.0, 30.0})
    levels_db.push_back(decibels(interface_level(
        scan(plane_scene(50.0, tilt), sweep, 80.0, ideal_scanner()), middle - 3, middle + 3)));
  EXPECT_GT(levels_db[0], levels_db[1] + 2.0);
  EXPECT_GT(levels_db[1], levels_db[2] + 6.0);
}

TEST(SpecularEcho, LiesOnTheInterface) {
  const SweepOptions sweep = small_sweep();
  const Echoes e = scan(plane_scene(50.0, 0.0), sweep, 80.0, ideal_scanner());
  EXPECT_NEAR(echo_depth_mm(e, sweep.lines / 2, sweep.frames / 2), 50.0, 0.3);
}

TEST(SpecularEcho, GrowsWithTheImpedanceStep) {
  const SweepOptions sweep = small_sweep();
  Scene gentle = plane_scene(50.0, 0.0);
  gentle.tissues[Tissue::kAgar].impedance_mrayl = 1.60;
  gentle.tissues[Tissue::kFat].impedance_mrayl = 1.50;
  Scene steep = plane_scene(50.0, 0.0);
  steep.tissues[Tissue::kAgar].impedance_mrayl = 1.60;
  steep.tissues[Tissue::kFat].impedance_mrayl = 1.30;
  const auto level = [&](const Scene& scene) {
    return interface_level(scan(scene, sweep, 80.0, ideal_scanner()), 15, 25);
  };
  // R = (Z2 - Z1) / (Z2 + Z1).
  const double expected = (0.30 / 2.90) / (0.10 / 3.10);
  EXPECT_NEAR(level(steep) / level(gentle), expected, 0.05 * expected);
}

TEST(SoundSpeedError, ScalesDepthByExactlyThatRatio) {
  const SweepOptions sweep = small_sweep();
  UltrasoundOptions wrong = ideal_scanner();
  wrong.sound_speed_error = 0.04;
  const Scene scene = plane_scene(50.0, 0.0);
  const int line = sweep.lines / 2;
  const double right_mm =
      echo_depth_mm(scan(scene, sweep, 80.0, ideal_scanner()), line, sweep.frames / 2);
  const double wrong_mm = echo_depth_mm(scan(scene, sweep, 80.0, wrong), line, sweep.frames / 2);
  EXPECT_NEAR(wrong_mm / right_mm, 1.04, 0.002);
}

TEST(TissueSpeeds, FatDelaysWhatLiesBelow) {
  // With 20 mm of fat at 1450 m/s, a scanner at 1540 m/s shows deeper echoes 20 (1540/1450 - 1) mm
  // too deep.
  Scene scene = simple_scene([](const Eigen::Vector3d& p) {
    if (p.y() < 10.0) return Tissue::kAgar;
    if (p.y() < 30.0) return Tissue::kSubcutaneousFat;
    return p.y() < 50.0 ? Tissue::kAgar : Tissue::kPlastic;
  });
  for (const Tissue t : {Tissue::kAgar, Tissue::kSubcutaneousFat, Tissue::kPlastic}) {
    scene.tissues[t].echogenicity_db = -300.0;
    scene.tissues[t].impedance_mrayl = t == Tissue::kPlastic ? 3.0 : 1.6;
    scene.tissues[t].speed_m_s = t == Tissue::kSubcutaneousFat ? 1450.0 : 1540.0;
  }
  UltrasoundOptions options = ideal_scanner();
  options.tissue_speeds = 1.0;
  const SweepOptions sweep = small_sweep();
  const Echoes e = scan(scene, sweep, 80.0, options);
  EXPECT_NEAR(echo_depth_mm(e, sweep.lines / 2, sweep.frames / 2),
              50.0 + 20.0 * (1540.0 / 1450.0 - 1.0), 0.3);
}

/// A rod of bone along the elevation axis, 10 mm thick, at 35 mm depth in muscle.
Scene rib_scene(Tissue rod) {
  return simple_scene([rod](const Eigen::Vector3d& p) {
    return std::hypot(p.x(), p.y() - 35.0) < 5.0 ? rod : Tissue::kMuscle;
  });
}

TEST(Shadow, IsDarkBehindARibAndHasSoftEdges) {
  UltrasoundOptions options = ideal_scanner();
  options.time_gain_compensation = true;
  SweepOptions sweep = small_sweep();
  sweep.lines = 81;
  sweep.lateral_fov_deg = 50.0;
  const Echoes e = scan(rib_scene(Tissue::kCorticalBone), sweep, 80.0, options);
  const auto level_db = [&](int line) {
    return decibels(rms(e, e.sample_at(60.0), e.sample_at(72.0), line - 1, line + 1) + 1e-9);
  };
  const int middle = sweep.lines / 2;
  const double core = level_db(middle);
  const double beside = level_db(middle + 36);
  EXPECT_LT(core, beside - 25.0);
  // Near the edge of the shadow, part of the aperture sees past the rib: no step from dark to
  // light.
  int between = 0;
  for (int l = middle; l < middle + 36; ++l) {
    const double level = level_db(l);
    between += level > core + 6.0 && level < beside - 6.0 ? 1 : 0;
  }
  EXPECT_GE(between, 3);
}

TEST(Reverberation, FillsTheShadowOfGasAndIsAKnob) {
  SweepOptions sweep = small_sweep();
  const auto shadow = [&](double reverberation) {
    UltrasoundOptions options = ideal_scanner();
    options.time_gain_compensation = true;
    options.reverberation = reverberation;
    const Echoes e = scan(rib_scene(Tissue::kGas), sweep, 80.0, options);
    const int middle = sweep.lines / 2;
    return decibels(rms(e, e.sample_at(36.0), e.sample_at(44.0), middle - 4, middle + 4) + 1e-9);
  };
  EXPECT_GT(shadow(1.0), shadow(0.0) + 15.0);
}

TEST(Contact, LinesWithoutItShowNoTissue) {
  SweepOptions sweep = small_sweep();
  UltrasoundOptions options = ideal_scanner();
  options.no_contact_lines = 10;
  const Echoes e = scan(homogeneous_scene(Tissue::kCortex), sweep, 60.0, options);
  int dark = 0;
  for (int l = 0; l < sweep.lines; ++l)
    dark += rms(e, e.sample_at(25.0), e.sample_at(35.0), l, l) < 0.01 ? 1 : 0;
  EXPECT_GE(dark, 6);
  EXPECT_LE(dark, 16);
}

TEST(Sweep, TrueMotorAnglesPlaceABallAndRecordedOnesMisplaceIt) {
  SweepOptions sweep = small_sweep();
  sweep.frames = 61;
  sweep.elevation_fov_deg = 44.0;
  sweep.sweep_error = 1.0;
  // In the probe frame the motor axis lies 27.25 mm above the array: at -16 degrees, 40 mm deep.
  const double radius_mm = 27.25 + 40.0;
  const Ball ball{
      {0.0, radius_mm * std::cos(16.0 * kDegree) - 27.25, -radius_mm * std::sin(16.0 * kDegree)},
      0.5,
      Tissue::kSteel};
  Scene scene = simple_scene([](const Eigen::Vector3d&) { return Tissue::kAgar; }, {ball});
  scene.tissues[Tissue::kAgar].echogenicity_db = -300.0;
  const Echoes e = scan(scene, sweep, 60.0, ideal_scanner());
  double weight = 0.0;
  double moment = 0.0;
  for (int f = 0; f < sweep.frames; ++f) {
    double energy = 0.0;
    for (int l = 0; l < sweep.lines; ++l)
      for (int i = e.sample_at(36.0); i < e.sample_at(44.0); ++i)
        energy += std::pow(e.at(i, l, f), 2);
    weight += energy;
    moment += energy * f;
  }
  const double frame = moment / weight;
  const double recorded_deg = (frame - 30.0) * 44.0 / 60.0;
  // Thesis 3.1.6: where 0.731 degrees were recorded, the slow half moved 0.611.
  EXPECT_NEAR(recorded_deg * 0.611 / 0.731, -16.0, 0.2);
}

TEST(Sweep, AContinuousSweepShowsABallWhereItsGeometrySays) {
  SweepOptions sweep = small_sweep();
  sweep.lateral_fov_deg = 40.0;
  sweep.frames = 25;
  sweep.elevation_fov_deg = 24.0;
  sweep.frame_travel_deg = 2.0;  // two frames' steps
  // The ball is near an edge of the fan, where the motor has moved on by almost half of the travel.
  const Ball ball{{17.0, 38.0, 9.0}, 0.5, Tissue::kSteel};
  Scene scene = simple_scene([](const Eigen::Vector3d&) { return Tissue::kAgar; }, {ball});
  scene.tissues[Tissue::kAgar].echogenicity_db = -300.0;
  const Echoes e = scan(scene, sweep, 60.0, ideal_scanner());
  double weight = 0.0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (int f = 0; f < sweep.frames; ++f)
    for (int l = 0; l < sweep.lines; ++l)
      for (int s = 0; s < sweep.samples; ++s) {
        const double energy = std::pow(e.at(s, l, f), 2);
        weight += energy;
        moment += energy * Eigen::Vector3d(s, l, f);
      }
  moment /= weight;
  const double radius_mm = std::get<CurvilinearArray>(e.geometry.array).probe_radius_mm;
  const ScanIndex expected =
      MotorisedInverse(e.geometry)
          .scan_from_us(ball.centre_ct_mm + Eigen::Vector3d(0.0, radius_mm, 0.0));
  EXPECT_NEAR(moment.x(), expected.sample, 3.0);  // half a ball nearer, samples of 0.3 mm
  EXPECT_NEAR(moment.y(), expected.line, 0.3);
  EXPECT_NEAR(moment.z(), expected.frame, 0.15);
}

TEST(Sweep, LagMakesFramesShowAnEarlierPlace) {
  SweepOptions sweep = small_sweep();
  sweep.kind = SweepKind::kTrackedLinear;
  sweep.elevation_fov_deg.reset();
  sweep.lateral_fov_deg.reset();
  sweep.linear_width_mm = 20.0;
  sweep.frames = 81;
  sweep.sweep_length_mm = 40.0;
  Scene scene = simple_scene([](const Eigen::Vector3d&) { return Tissue::kAgar; },
                             {{{0.0, 30.0, 0.0}, 0.5, Tissue::kSteel}});
  scene.tissues[Tissue::kAgar].echogenicity_db = -300.0;
  const auto brightest_frame = [&](double lag_s) {
    SweepOptions lagging = sweep;
    lagging.lag_s = lag_s;
    const Echoes e = scan(scene, lagging, 50.0, ideal_scanner());
    double best = 0.0;
    int frame = -1;
    for (int f = 0; f < sweep.frames; ++f)
      for (int l = 0; l < sweep.lines; ++l)
        for (int s = 0; s < sweep.samples; ++s)
          if (e.at(s, l, f) > best) {
            best = e.at(s, l, f);
            frame = f;
          }
    return frame;
  };
  // The ball is passed in the middle of the sweep and appears 0.5 s later, 10 frames at 20
  // frames/s.
  EXPECT_EQ(brightest_frame(0.5) - brightest_frame(0.0), 10);
}

TEST(Sweep, DuplicatesRepeatTheImageButNotThePose) {
  SweepOptions sweep = small_sweep();
  sweep.kind = SweepKind::kTrackedCurvilinear;
  sweep.elevation_fov_deg.reset();
  sweep.frames = 40;
  sweep.sweep_length_mm = 30.0;
  sweep.duplicate_fraction = 0.3;
  const Acquisition acquisition = make_acquisition(sweep, 50.0, 1e6, 7);
  const Scene scene = homogeneous_scene(Tissue::kLiver);
  UltrasoundOptions options = ideal_scanner();
  options.penetration_mm = 60.0;  // noise, so that only a copy is equal
  const std::vector<float> envelope = form_echoes(scene, {}, acquisition, options, 7);
  const auto size = static_cast<std::ptrdiff_t>(sweep.samples * sweep.lines);
  const auto& recorded = std::get<TrackedSweep>(acquisition.recorded.motion);
  int equal = 0;
  for (int f = 1; f < sweep.frames; ++f) {
    const bool same = std::equal(envelope.begin() + f * size, envelope.begin() + (f + 1) * size,
                                 envelope.begin() + (f - 1) * size);
    const auto n = static_cast<std::size_t>(f);
    EXPECT_EQ(same, acquisition.image_of_frame[n] != f) << f;
    EXPECT_FALSE(recorded.T_us_frame[n].isApprox(recorded.T_us_frame[n - 1], 1e-9));
    equal += same ? 1 : 0;
  }
  EXPECT_GE(equal, 5);
  EXPECT_LE(equal, 20);
}

TEST(Sweep, PoseNoiseHasTheSizeAskedFor) {
  SweepOptions sweep = small_sweep();
  sweep.kind = SweepKind::kTrackedCurvilinear;
  sweep.elevation_fov_deg.reset();
  sweep.frames = 400;
  sweep.pose_noise_mm = 0.7;
  const Acquisition acquisition = make_acquisition(sweep, 50.0, 1e6, 3);
  const auto& recorded = std::get<TrackedSweep>(acquisition.recorded.motion).T_us_frame;
  const auto& truth = std::get<TrackedSweep>(acquisition.truth.motion).T_us_frame;
  double squares = 0.0;
  for (std::size_t f = 0; f < truth.size(); ++f)
    squares += (recorded[f].translation() - truth[f].translation()).squaredNorm();
  EXPECT_NEAR(std::sqrt(squares / (3.0 * 400.0)), 0.7, 0.06);
}

}  // namespace
}  // namespace usct::phantom::test
