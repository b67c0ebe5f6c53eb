#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/registration/random_points.h"
#include "core/registration/symmetric_sweeps.h"
#include "registration/evidence/expected_error.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/registration/registration_options.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using registration::HalfPoses;
using registration::pose_covariance;

const Isometry3d kHere = Isometry3d::Identity();
const Vector3d kCentre(0.0, 60.0, 0.0);

BeamGrid motorised() { return symmetric_motorised(40, 9, 7, 0.05, 0.05); }

/// No error but that of the halves.
ErrorOptions halves_alone(double factor = 1.0) {
  ErrorOptions options;
  options.parts_factor = factor;
  options.sound_speed_share = options.sweep_share = options.lag_frames = options.other_mm = 0.0;
  return options;
}

double expected_mm(const std::vector<HalfPoses>& halves, const ErrorOptions& options,
                   const BeamGrid& beams = motorised(), const Vector3d& at_us_mm = kCentre) {
  return expected_tre_mm(pose_covariance(halves, beams, kCentre, options), {at_us_mm}).rms_mm;
}

Isometry3d shifted(const Vector3d& by_mm) { return Isometry3d(Eigen::Translation3d(by_mm)); }

TEST(ExpectedError, IsHalfTheDistanceOfTheHalvesAveragedOverBothWaysToHalve) {
  const HalfPoses lines{shifted({1, 0, 0}), shifted({-1, 2, 1}), kHere, kHere};  // 3 mm apart
  const HalfPoses both{lines.left, lines.right, shifted({0, 4, 0}), kHere};      // and 4 mm
  EXPECT_NEAR(expected_mm({lines}, halves_alone()), 1.5 / std::sqrt(2.0), 1e-9);
  EXPECT_NEAR(expected_mm({both}, halves_alone()), std::sqrt((1.5 * 1.5 + 2.0 * 2.0) / 2.0), 1e-9);
  EXPECT_NEAR(expected_mm({both}, halves_alone(3.0)), 3.0 * expected_mm({both}, halves_alone()),
              1e-9);
  // Several similarities estimate the same covariance.
  EXPECT_NEAR(expected_mm({both, both}, halves_alone()), expected_mm({both}, halves_alone()), 1e-9);
  EXPECT_NEAR(expected_mm({lines, {kHere, kHere, kHere, kHere}}, halves_alone()), 0.75, 1e-9);
}

/// Halves that differ by a turn about an axis through a point disagree in proportion to the
/// distance from the axis.
TEST(ExpectedError, GrowsWithTheDistanceFromTheAxisOfATurn) {
  constexpr double kTurnRad = 1e-3;
  const Eigen::Translation3d to_centre(kCentre);
  const Isometry3d turned(to_centre * Eigen::AngleAxisd(kTurnRad, Vector3d::UnitX()) *
                          to_centre.inverse());
  const HalfPoses halves{kHere, turned, kHere, kHere};
  for (const double distance_mm : {0.0, 10.0, 40.0})
    EXPECT_NEAR(expected_mm({halves}, halves_alone(), motorised(),
                            kCentre + distance_mm * Vector3d::UnitZ()),
                0.5 * kTurnRad * distance_mm / std::sqrt(2.0), 1e-4);
}

TEST(ExpectedError, OfTheSpeedOfSoundGrowsWithDepthAlongTheBeams) {
  ErrorOptions options = halves_alone();
  options.sound_speed_share = 0.02;
  // The lines start at y = 0, and run along y.
  const BeamGrid beams = straight_tracked(40, 9, 7, 1.0);
  const Matrix6d covariance =
      pose_covariance({{kHere, kHere, kHere, kHere}}, beams, kCentre, options);
  Matrix6d expected = Matrix6d::Zero();
  expected(4, 4) = 1.2 * 1.2;  // 0.02 times 60 mm
  EXPECT_TRUE(covariance.isApprox(expected, 1e-9)) << covariance;
}

TEST(ExpectedError, OfALagIsAlongATrackedSweepAlone) {
  ErrorOptions options = halves_alone();
  options.lag_frames = 1.5;
  const HalfPoses same{kHere, kHere, kHere, kHere};
  const Matrix6d covariance =
      pose_covariance({same}, straight_tracked(40, 9, 7, 2.0), kCentre, options);
  Matrix6d expected = Matrix6d::Zero();
  expected(5, 5) = 3.0 * 3.0;  // 1.5 frames of 2 mm, along z
  EXPECT_TRUE(covariance.isApprox(expected, 1e-9)) << covariance;
  EXPECT_EQ(expected_mm({same}, options, motorised()), 0.0);
  EXPECT_EQ(expected_mm({same}, options, straight_tracked(40, 9, 1, 2.0)), 0.0);
}

/// Of a probe that turns about its middle line the middle of the field stays where it is.
TEST(ExpectedError, OfALagIsThatOfPlacesThatMove) {
  ErrorOptions options = halves_alone();
  options.lag_frames = 1.0;
  BeamGrid beams = straight_tracked(40, 9, 30, 0.0);
  for (int frame = 0; frame < beams.frames; ++frame)
    for (int line = 0; line < beams.lines; ++line) {
      Beam& beam = beams.beams[static_cast<std::size_t>(frame * beams.lines + line)];
      beam.origin_mm = Eigen::AngleAxisd(0.02 * frame, Vector3d::UnitY()) * beam.origin_mm;
    }
  EXPECT_GT(expected_mm({{kHere, kHere, kHere, kHere}}, options, beams), 0.02);
}

/// A probe that rests before it moves has the lag of its frames that move.
TEST(ExpectedError, OfALagIsThatOfFramesThatMove) {
  ErrorOptions options = halves_alone();
  options.lag_frames = 1.5;
  BeamGrid beams = straight_tracked(40, 9, 7, 2.0);
  const std::vector<Beam> first(beams.beams.begin(), beams.beams.begin() + beams.lines);
  for (int i = 0; i < 100; ++i, ++beams.frames)
    beams.beams.insert(beams.beams.begin(), first.begin(), first.end());
  const Matrix6d covariance =
      pose_covariance({{kHere, kHere, kHere, kHere}}, beams, kCentre, options);
  EXPECT_NEAR(std::sqrt(covariance(5, 5)), 3.0, 1e-9);
}

/// Frames in air before and after a sweep are no part of its path.
TEST(ExpectedError, IsThatOfTheRecordedFramesThatCount) {
  const auto conditioned = [](BeamGrid beams, int air_before, int air_after) {
    const auto per_frame = static_cast<std::size_t>(beams.lines) * 40;
    BeamUltrasound us{std::move(beams), {}, {}};
    us.known.assign(us.beams.beams.size() * 40, 1);
    std::fill_n(us.known.begin(), static_cast<std::size_t>(air_before) * per_frame, 0);
    std::fill_n(us.known.rbegin(), static_cast<std::size_t>(air_after) * per_frame, 0);
    return us;
  };
  const BeamGrid beams = straight_tracked(40, 9, 24, 1.0);
  const BeamGrid counting =
      registration::frames_that_count(beams, conditioned(straight_tracked(40, 9, 8, 3.0), 2, 1));
  ASSERT_EQ(counting.frames, 13);  // from the middle of the third block of three to that of the 7th
  EXPECT_EQ(counting.beams.front().origin_mm, beams.beam(7, 0).origin_mm);
  EXPECT_EQ(counting.beams.back().origin_mm, beams.beam(19, 8).origin_mm);
  EXPECT_EQ(registration::frames_that_count(beams, conditioned(beams, 0, 0)).frames, 24);
  EXPECT_EQ(registration::frames_that_count(beams, conditioned(beams, 24, 0)).frames, 1);
  EXPECT_EQ(registration::frames_that_count(motorised(), conditioned(motorised(), 2, 2)).frames, 7);
}

/// Of 7 frames, 2 mm apart, the three on one side of the middle lie too far away by 16 %. The shift
/// that brings all of them closest to their places is the mean of 0.96, 0.64, 0.32 and four zeros;
/// half of a side times 8 % is its limit for many frames.
TEST(ExpectedError, OfASweepThatIsWrongOnOneSideIsAcrossTheFrames) {
  const HalfPoses same{kHere, kHere, kHere, kHere};
  AcquisitionErrors shown;
  shown.sweep = -0.08;
  const Matrix6d covariance =
      pose_covariance({same}, straight_tracked(40, 9, 7, 2.0), kCentre, halves_alone(), shown);
  Matrix6d expected = Matrix6d::Zero();
  expected(5, 5) = std::pow(0.08 * 6.0 / 2.0, 2);  // a side is 6 mm long
  EXPECT_TRUE(covariance.isApprox(expected, 1e-9)) << covariance;
  EXPECT_NEAR(std::sqrt(covariance(5, 5)), (0.96 + 0.64 + 0.32) / 7.0, 0.05);
}

/// What a corrected sweep is still wrong by is known no better than the correction.
TEST(ExpectedError, OfACorrectedSweepIsThatOfTheCorrection) {
  const HalfPoses same{kHere, kHere, kHere, kHere};
  ErrorOptions options = halves_alone();
  options.sweep_share = 0.04;
  BeamGrid beams = straight_tracked(40, 9, 7, 2.0);
  AcquisitionErrors shown;
  shown.sweep = -0.01;
  const auto across_mm = [&] {
    return std::sqrt(pose_covariance({same}, beams, kCentre, options, shown)(5, 5));
  };
  EXPECT_NEAR(across_mm(), 0.01 * 6.0 / 2.0, 1e-9);
  beams.corrected_sweep = true;
  EXPECT_NEAR(across_mm(), 0.04 * 6.0 / 2.0, 1e-9);
  shown.sweep = -0.08;
  EXPECT_NEAR(across_mm(), 0.08 * 6.0 / 2.0, 1e-9);
}

TEST(ExpectedError, OfDepthsThatShowsCountsWhereItIsMoreThanWhatNoImageShows) {
  const HalfPoses same{kHere, kHere, kHere, kHere};
  const BeamGrid beams = straight_tracked(40, 9, 7, 1.0);
  ErrorOptions options = halves_alone();
  options.sound_speed_share = 0.02;
  for (const double depth : {-0.05, -0.01, 0.01, 0.05}) {
    AcquisitionErrors shown;
    shown.depth = depth;
    const double expected = 60.0 * std::max(0.02, std::abs(depth));
    EXPECT_NEAR(std::sqrt(pose_covariance({same}, beams, kCentre, options, shown)(4, 4)), expected,
                1e-9);
  }
}

TEST(ExpectedError, OfAllElseIsTheSameInEveryDirection) {
  ErrorOptions options = halves_alone();
  options.other_mm = 0.6;
  const HalfPoses same{kHere, kHere, kHere, kHere};
  const Matrix6d covariance = pose_covariance({same}, motorised(), kCentre, options);
  Matrix6d expected = Matrix6d::Zero();
  expected.diagonal().tail<3>().setConstant(0.12);
  EXPECT_TRUE(covariance.isApprox(expected, 1e-9)) << covariance;
  EXPECT_NEAR(expected_mm({same}, options), 0.6, 1e-9);
}

TEST(ExpectedError, AddsIndependentErrorsByTheirSquares) {
  const HalfPoses halves{shifted({1, 0, 0}), shifted({-1, 2, 1}), kHere, kHere};
  const BeamGrid beams = straight_tracked(40, 9, 7, 2.0);
  ErrorOptions all = halves_alone();
  const double of_halves = expected_mm({halves}, all, beams);
  all.sound_speed_share = 0.02;
  all.lag_frames = 1.5;
  all.other_mm = 0.6;
  EXPECT_NEAR(expected_mm({halves}, all, beams),
              std::sqrt(of_halves * of_halves + 1.2 * 1.2 + 3.0 * 3.0 + 0.6 * 0.6), 1e-9);
}

/// Seen from another US frame, also one as far away as a tracker may be.
RC_GTEST_PROP(ExpectedError, FollowsTheUltrasoundFrame, ()) {
  const auto near = [] {
    return Isometry3d(shifted(random_vector(1.0)) *
                      Eigen::AngleAxisd(uniform(0.0, 0.05), random_direction()));
  };
  const HalfPoses here{near(), near(), near(), near()};
  const Isometry3d motion = shifted(random_vector(10000.0)) * random_pose();
  const HalfPoses there{motion * here.left, motion * here.right, motion * here.first,
                        motion * here.last};
  const BeamGrid beams = straight_tracked(40, 9, 7, 2.0);
  BeamGrid moved = beams;
  for (Beam& beam : moved.beams) beam = {motion * beam.origin_mm, motion.linear() * beam.direction};
  ErrorOptions options;
  options.sound_speed_share = 0.02;
  const Vector3d target = kCentre + random_vector(30.0);
  const double error_here =
      expected_tre_mm(pose_covariance({here}, beams, kCentre, options), {target}).rms_mm;
  const double error_there =
      expected_tre_mm(pose_covariance({there}, moved, motion * kCentre, options), {motion * target})
          .rms_mm;
  RC_ASSERT(std::abs(error_there - error_here) < 1e-4 * error_here);
}

RC_GTEST_PROP(ExpectedError, CovarianceIsSymmetricAndHasTheRankOfItsErrors, ()) {
  const auto near = [] {
    return Isometry3d(shifted(random_vector(5.0)) *
                      Eigen::AngleAxisd(uniform(0.0, 0.2), random_direction()));
  };
  const HalfPoses halves{near(), near(), near(), near()};
  const auto rank_of = [&](const ErrorOptions& options) {
    const Matrix6d covariance = pose_covariance({halves}, motorised(), kCentre, options);
    RC_ASSERT(covariance == covariance.transpose());
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(covariance);
    const double greatest = eigen.eigenvalues().maxCoeff();
    RC_ASSERT(eigen.eigenvalues().minCoeff() > -1e-9 * greatest);
    return (eigen.eigenvalues().array() > 1e-9 * greatest).count();
  };
  RC_ASSERT(rank_of(halves_alone()) <= 2);
  ErrorOptions with_shifts = halves_alone();
  with_shifts.other_mm = 1.0;
  RC_ASSERT(rank_of(with_shifts) <= 5);
  RC_ASSERT(rank_of(with_shifts) >= 3);
}

}  // namespace
}  // namespace usct::test
