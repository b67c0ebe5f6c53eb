#include <gtest/gtest.h>

#include "core/phantom/simple_scenes.h"

namespace usct::phantom::test {
namespace {

Scene silent_attenuation(Scene scene) {
  for (int t = 0; t < kTissueCount; ++t)
    scene.tissues[static_cast<Tissue>(t)].attenuation_db_cm_mhz = 0.0;
  return scene;
}

/// Fully developed speckle has a Rayleigh distribution: mean over standard deviation of the
/// envelope is sqrt(pi / (4 - pi)) = 1.91 (Burckhardt 1978), and the mean squared intensity is
/// twice the square of its mean.
TEST(Speckle, IsFullyDeveloped) {
  SweepOptions sweep = small_sweep();
  sweep.lines = 81;
  sweep.lateral_fov_deg = 60.0;
  sweep.frames = 13;
  sweep.elevation_fov_deg = 36.0;
  const Echoes e =
      scan(silent_attenuation(homogeneous_scene(Tissue::kCortex)), sweep, 90.0, ideal_scanner());
  double sum = 0.0;
  double squares = 0.0;
  double fourth = 0.0;
  double count = 0.0;
  for (int f = 0; f < e.geometry.frames(); ++f)
    for (int l = 0; l < e.geometry.lines(); ++l)
      for (int s = e.sample_at(40.0); s < e.sample_at(80.0); ++s) {
        const double a = e.at(s, l, f);
        sum += a;
        squares += a * a;
        fourth += a * a * a * a;
        count += 1.0;
      }
  const double mean = sum / count;
  const double deviation = std::sqrt(squares / count - mean * mean);
  EXPECT_NEAR(mean / deviation, 1.913, 0.04);
  EXPECT_NEAR(fourth / count / std::pow(squares / count, 2), 2.0, 0.08);
  // Level 1 is renal cortex by definition of the options.
  EXPECT_NEAR(std::sqrt(squares / count), 1.0, 0.06);
}

/// Distance in mm at which the lateral correlation of the intensity falls to one half.
double lateral_correlation_mm(const Echoes& e, double depth_mm) {
  const int first = e.sample_at(depth_mm - 8.0);
  const int last = e.sample_at(depth_mm + 8.0);
  const int lines = e.geometry.lines();
  const auto intensity = [&](int s, int l, int f) { return std::pow(e.at(s, l, f), 2); };
  double mean = 0.0;
  int count = 0;
  for (int f = 0; f < e.geometry.frames(); ++f)
    for (int l = 0; l < lines; ++l)
      for (int s = first; s < last; ++s, ++count) mean += intensity(s, l, f);
  mean /= count;
  const auto covariance = [&](int lag) {
    double sum = 0.0;
    int n = 0;
    for (int f = 0; f < e.geometry.frames(); ++f)
      for (int l = 0; l + lag < lines; ++l)
        for (int s = first; s < last; ++s, ++n)
          sum += (intensity(s, l, f) - mean) * (intensity(s, l + lag, f) - mean);
    return sum / n;
  };
  const auto& array = std::get<CurvilinearArray>(e.geometry.array);
  const double pitch_mm =
      (array.probe_radius_mm + depth_mm) * (array.line_angles_rad[1] - array.line_angles_rad[0]);
  const double zero = covariance(0);
  double before = 1.0;
  for (int lag = 1; lag < 20; ++lag) {
    const double now = covariance(lag) / zero;
    if (now < 0.5) return pitch_mm * (lag - 1 + (before - 0.5) / (before - now));
    before = now;
  }
  return 1e9;
}

TEST(Speckle, WidensWithDepthBeyondTheFocus) {
  SweepOptions sweep = small_sweep();
  sweep.lines = 121;
  sweep.lateral_fov_deg = 40.0;
  sweep.frames = 7;
  sweep.elevation_fov_deg = 18.0;
  UltrasoundOptions options = ideal_scanner();
  options.transmit_focus_mm = 50.0;
  const Echoes e =
      scan(silent_attenuation(homogeneous_scene(Tissue::kCortex)), sweep, 130.0, options);
  const double at_focus = lateral_correlation_mm(e, 50.0);
  const double beyond = lateral_correlation_mm(e, 118.0);
  // Aperture 16 mm, wavelength 0.308 mm: the correlation length at the focus is about a millimetre.
  EXPECT_GT(at_focus, 0.4);
  EXPECT_LT(at_focus, 1.6);
  EXPECT_GT(beyond, 1.6 * at_focus);
}

TEST(Speckle, StaysWithTheTissueWhenTheProbeMoves) {
  // Frames that overlap show nearly the same speckle, frames further apart an independent one.
  SweepOptions sweep = small_sweep();
  sweep.frames = 31;
  sweep.elevation_fov_deg = 6.0;
  const Echoes e =
      scan(silent_attenuation(homogeneous_scene(Tissue::kCortex)), sweep, 80.0, ideal_scanner());
  const auto correlation = [&](int f, int g) {
    double fg = 0.0, ff = 0.0, gg = 0.0, mf = 0.0, mg = 0.0;
    int n = 0;
    for (int l = 0; l < e.geometry.lines(); ++l)
      for (int s = e.sample_at(40.0); s < e.sample_at(70.0); ++s, ++n) {
        mf += e.at(s, l, f);
        mg += e.at(s, l, g);
        fg += e.at(s, l, f) * e.at(s, l, g);
        ff += std::pow(e.at(s, l, f), 2);
        gg += std::pow(e.at(s, l, g), 2);
      }
    return (fg - mf * mg / n) / std::sqrt((ff - mf * mf / n) * (gg - mg * mg / n));
  };
  EXPECT_GT(correlation(15, 16), 0.8);
  EXPECT_LT(std::abs(correlation(0, 30)), 0.3);
}

TEST(Attenuation, FallsOffAsTheTissueAttenuatesWithoutTgc) {
  SweepOptions sweep = small_sweep();
  sweep.lateral_fov_deg = 40.0;
  sweep.elevation_fov_deg = 24.0;
  UltrasoundOptions options = ideal_scanner();
  options.frequency_mhz = 4.0;
  const Scene scene = homogeneous_scene(Tissue::kLiver);
  const Echoes e = scan(scene, sweep, 100.0, options);
  // Least squares line through the level of slices of 5 mm.
  double n = 0.0, x1 = 0.0, y1 = 0.0, xx = 0.0, xy = 0.0;
  for (double depth = 15.0; depth < 95.0; depth += 5.0, n += 1.0) {
    const double level = decibels(
        rms(e, e.sample_at(depth), e.sample_at(depth + 5.0) - 1, 0, e.geometry.lines() - 1));
    const double middle_cm = 0.1 * (depth + 2.5);
    x1 += middle_cm;
    y1 += level;
    xx += middle_cm * middle_cm;
    xy += middle_cm * level;
  }
  const double slope_db_cm = (n * xy - x1 * y1) / (n * xx - x1 * x1);
  const double expected = -2.0 * 4.0 * scene.tissues[Tissue::kLiver].attenuation_db_cm_mhz;
  EXPECT_NEAR(slope_db_cm, expected, 0.04 * std::abs(expected));
}

TEST(Attenuation, IsUndoneByTgc) {
  UltrasoundOptions options = ideal_scanner();
  options.time_gain_compensation = true;
  const Echoes e = scan(homogeneous_scene(Tissue::kCortex), small_sweep(), 90.0, options);
  const int last_line = e.geometry.lines() - 1;
  for (const double depth : {20.0, 50.0, 80.0})
    EXPECT_NEAR(decibels(rms(e, e.sample_at(depth), e.sample_at(depth + 8.0), 0, last_line)), 0.0,
                1.5)
        << depth;
}

TEST(Noise, RisesWithDepthWhenTheScannerIsWeak) {
  UltrasoundOptions options = ideal_scanner();
  options.time_gain_compensation = true;
  // The tissue attenuates like soft tissue and does not scatter, so that only noise is visible.
  Scene scene = homogeneous_scene(Tissue::kMuscle);
  scene.tissues[Tissue::kMuscle].echogenicity_db = -300.0;
  scene.tissues[Tissue::kMuscle].attenuation_db_cm_mhz = 0.5;
  options.penetration_mm = 100.0;
  const Echoes e = scan(scene, small_sweep(), 80.0, options);
  const auto level = [&](double depth) {
    return decibels(
        rms(e, e.sample_at(depth - 2.0), e.sample_at(depth + 2.0), 0, e.geometry.lines() - 1));
  };
  // 0.5 dB/cm/MHz both ways at 5 MHz: 0.5 dB per mm, equal to cortex at 100 mm.
  EXPECT_NEAR(level(60.0), -20.0, 1.0);
  EXPECT_NEAR(level(60.0) - level(20.0), 20.0, 1.0);
}

}  // namespace
}  // namespace usct::phantom::test
