#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/evaluation/ball_detection.h"
#include "us_ct_registration/evaluation/fiducial_matching.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::test {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

/// A motorised sweep of 100 samples, 64 lines and 41 frames.
PreScanVolume dark_sweep() {
  PreScanVolume us;
  us.geometry.axial = {100, 5.0, 0.5};
  CurvilinearArray array;
  array.probe_radius_mm = 40.0;
  for (int l = 0; l < 64; ++l) array.line_angles_rad.push_back(0.0106 * (l - 31.5));
  MotorSweep sweep;
  sweep.motor_radius_mm = 27.25;
  for (int f = 0; f < 41; ++f) sweep.frame_angles_rad.push_back(0.0128 * (f - 20));
  us.geometry.array = array;
  us.geometry.motion = sweep;
  us.voxels.assign(100U * 64U * 41U, 20);
  return us;
}

/// Adds an echo whose grey values fall with the square of the distance, as those of a Gaussian echo
/// do after log compression.
void add_echo(PreScanVolume& us, const ScanIndex& at) {
  for (int f = 0; f < us.geometry.frames(); ++f)
    for (int l = 0; l < us.geometry.lines(); ++l)
      for (int s = 0; s < us.geometry.samples(); ++s) {
        const double grey = 210.0 - 40.0 * std::pow(s - at.sample, 2.0) -
                            15.0 * std::pow(l - at.line, 2.0) - 6.0 * std::pow(f - at.frame, 2.0);
        std::uint8_t& voxel = us.voxels[us.offset(s, l, f)];
        voxel = std::max(voxel, static_cast<std::uint8_t>(std::max(grey, 0.0)));
      }
}

double least_distance_mm(const Vector3d& point, const BallDetection& found) {
  double least = 1e9;
  for (const DetectedBall& ball : found.balls)
    least = std::min(least, (ball.centre_mm - point).norm());
  return least;
}

/// The echo is that of the top, and the centre lies a radius behind it along the beam.
RC_GTEST_PROP(UsBalls, CentresLieARadiusBehindTheirEchoes, ()) {
  PreScanVolume us = dark_sweep();
  UsBallOptions options;
  options.diameter_mm = uniform(1.0, 4.0);
  Points centres;
  for (const ScanIndex& base : {ScanIndex{30, 15, 12}, {55, 45, 15}, {60, 25, 30}}) {
    const Vector3d shift = random_vector(2.0);
    const ScanIndex top{base.sample + shift.x(), base.line + shift.y(), base.frame + shift.z()};
    add_echo(us, top);
    // Spacing 0.5 mm: the radius is as many samples as the diameter has millimetres.
    centres.push_back(
        us_from_scan(us.geometry, {top.sample + options.diameter_mm, top.line, top.frame}));
  }
  const BallDetection found = detect_balls(us, options);
  RC_ASSERT(found.balls.size() == centres.size());
  for (const Vector3d& centre : centres) RC_ASSERT(least_distance_mm(centre, found) < 0.1);
}

TEST(UsBalls, InterfacesAreNoBallsAndEchoesAtTheBorderAreRefused) {
  PreScanVolume us = dark_sweep();
  add_echo(us, {30.3, 30.2, 20.4});
  add_echo(us, {50.0, 63.0, 20.0});
  for (int f = 0; f < us.geometry.frames(); ++f)
    for (int l = 0; l < us.geometry.lines(); ++l)
      for (int s = 80; s < 83; ++s) us.voxels[us.offset(s, l, f)] = 220;
  const BallDetection found = detect_balls(us, UsBallOptions{});
  EXPECT_EQ(found.balls.size(), 1U);
  ASSERT_EQ(found.refused.size(), 1U);
  EXPECT_EQ(found.refused[0].reason, "is cut by the border of the ultrasound");
  UsBallOptions options;
  options.echo_radius_mm = 0.0;
  expect_input_error([&] { detect_balls(us, options); }, {"echo_radius_mm", "0"});
}

/// The phantom forms its images from scatterers and partial volumes, and knows where its balls are.
TEST(UsBalls, OfThePhantomAreFoundInBothImagesAndMatched) {
  phantom::PhantomOptions options;
  options.seed = 3;
  options.sweep.depth_mm = 50.0;
  options.sweep.samples = 80;
  options.sweep.frames = 51;
  options.anatomy.ball_diameter_mm = 1.5;
  options.ct.size = {180, 150, 60};
  const phantom::PhantomCase made = phantom::make_phantom(options);
  CtBallOptions in_ct;
  in_ct.diameter_mm = 1.5;
  const BallDetection ct = detect_balls(made.ct, in_ct);
  ASSERT_EQ(ct.balls.size(), 4U);
  for (const Vector3d& truth : made.truth.fiducials_ct_mm)
    EXPECT_LT(least_distance_mm(truth, ct), 0.1);
  UsBallOptions in_us;
  in_us.diameter_mm = 1.5;
  const BallDetection us = detect_balls(made.ultrasound, in_us);
  for (const Vector3d& truth : made.truth.fiducials_us_mm)
    EXPECT_LT(least_distance_mm(truth, us), 0.4);

  Points us_mm;
  Points ct_mm;
  for (const DetectedBall& ball : us.balls) us_mm.push_back(ball.centre_mm);
  for (const DetectedBall& ball : ct.balls) ct_mm.push_back(ball.centre_mm);
  const FiducialMatching matching = match_fiducials(us_mm, ct_mm, 0.5);
  EXPECT_LT(matching.fitting[0].fre_mm, 0.3);
  for (const auto& [i, j] : matching.fitting[0].pairs)
    EXPECT_LT((made.truth.T_us_ct * ct_mm[j] - us_mm[i]).norm(), 0.5);
}

}  // namespace
}  // namespace usct::test
