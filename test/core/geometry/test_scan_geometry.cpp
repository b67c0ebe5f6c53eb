#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <functional>
#include <limits>

#include "random_geometry.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/scan_geometry.h"

namespace usct {
namespace {

using test::integer;
using test::random_axial;
using test::random_curvilinear;
using test::random_motorised;
using test::random_pose;
using test::uneven_table;
using test::uniform;

constexpr double kRoundTrip_mm = 1e-9;

const CurvilinearArray& array_of(const ScanGeometry& geometry) {
  return std::get<CurvilinearArray>(geometry.array);
}

/// Thesis eqs 4.11-4.14 as they are printed.
Eigen::Vector3d printed_equations(double probe_radius, double motor_radius, double depth,
                                  double theta, double phi) {
  const double D = probe_radius - motor_radius;
  const double h = probe_radius + depth;
  const double H = h * std::cos(theta);  // 4.11
  return {H * std::tan(theta),           // 4.12
          (H - D) * std::cos(phi) + D,   // 4.13
          (H - D) * std::sin(phi)};      // 4.14
}

/// A continuous index in the recorded range.
ScanIndex random_index(const ScanGeometry& geometry) {
  return {uniform(-0.5, geometry.samples() - 0.5), uniform(0.0, geometry.lines() - 1.0),
          uniform(0.0, geometry.frames() - 1.0)};
}

RC_GTEST_PROP(MotorisedGeometry, AgreesWithThePrintedEquations, ()) {
  ScanGeometry geometry = random_motorised();
  auto& sweep = std::get<MotorSweep>(geometry.motion);
  const int sample = integer(0, geometry.samples());
  const int line = integer(0, geometry.lines());
  const int frame = integer(0, geometry.frames());
  // Line after line, the motor moves by frame_travel / lines; the table holds the middle.
  const double travel =
      sweep.frame_travel_rad * (line - 0.5 * (geometry.lines() - 1)) / geometry.lines();
  const Eigen::Vector3d expected =
      printed_equations(array_of(geometry).probe_radius_mm, sweep.motor_radius_mm,
                        geometry.axial.start_depth_mm + sample * geometry.axial.spacing_mm,
                        array_of(geometry).line_angles_rad[static_cast<std::size_t>(line)],
                        sweep.frame_angles_rad[static_cast<std::size_t>(frame)] + travel);
  const Eigen::Vector3d p = us_from_scan(
      geometry,
      {static_cast<double>(sample), static_cast<double>(line), static_cast<double>(frame)});
  RC_ASSERT((p - expected).norm() < kRoundTrip_mm);
}

RC_GTEST_PROP(MotorisedGeometry, BetweenFramesTheMotorAngleIsLinear, ()) {
  ScanGeometry geometry = random_motorised();
  auto& sweep = std::get<MotorSweep>(geometry.motion);
  sweep.frame_travel_rad = 0.0;
  const auto frame = static_cast<std::size_t>(integer(0, geometry.frames() - 1));
  const double phi = 0.5 * (sweep.frame_angles_rad[frame] + sweep.frame_angles_rad[frame + 1]);
  const Eigen::Vector3d expected =
      printed_equations(array_of(geometry).probe_radius_mm, sweep.motor_radius_mm,
                        geometry.axial.start_depth_mm, array_of(geometry).line_angles_rad[0], phi);
  const Eigen::Vector3d p = us_from_scan(geometry, {0.0, 0.0, static_cast<double>(frame) + 0.5});
  RC_ASSERT((p - expected).norm() < kRoundTrip_mm);
}

RC_GTEST_PROP(MotorisedGeometry, ForwardThenInverseReturns, ()) {
  const ScanGeometry geometry = random_motorised();
  const MotorisedInverse inverse(geometry);
  for (int n = 0; n < 50; ++n) {
    const ScanIndex index = random_index(geometry);
    const Eigen::Vector3d p = us_from_scan(geometry, index);
    const ScanIndex back = inverse.scan_from_us(p);
    RC_ASSERT((us_from_scan(geometry, back) - p).norm() < kRoundTrip_mm);
    // The index itself is recovered, not another one with the same point.
    RC_ASSERT(std::abs(back.sample - index.sample) < 1e-7);
    RC_ASSERT(std::abs(back.line - index.line) < 1e-7);
    RC_ASSERT(std::abs(back.frame - index.frame) < 1e-7);
  }
}

RC_GTEST_PROP(MotorisedGeometry, InverseThenForwardReturnsForPointsAnywhere, ()) {
  const ScanGeometry geometry = random_motorised();
  const MotorisedInverse inverse(geometry);
  for (int n = 0; n < 50; ++n) {
    const Eigen::Vector3d p(uniform(-200, 200), uniform(-200, 200), uniform(-200, 200));
    RC_ASSERT((us_from_scan(geometry, inverse.scan_from_us(p)) - p).norm() < kRoundTrip_mm);
  }
}

RC_GTEST_PROP(TrackedGeometry, ForwardThenInverseReturnsInTheFrame, ()) {
  ScanGeometry geometry;
  geometry.axial = random_axial();
  if (*rc::gen::arbitrary<bool>())
    geometry.array = random_curvilinear();
  else
    geometry.array = LinearArray{uneven_table(integer(2, 200), -30.0, 25.0)};
  geometry.motion = TrackedSweep{{random_pose(), random_pose(), random_pose()}, {}};
  geometry.validate("random");
  ScanIndex index = random_index(geometry);
  index.frame = integer(0, 3);
  const Eigen::Vector3d p_us = us_from_scan(geometry, index);
  const Eigen::Isometry3d T_us_frame =
      std::get<TrackedSweep>(geometry.motion).T_us_frame[static_cast<std::size_t>(index.frame)];
  const Eigen::Vector3d p_frame = T_us_frame.inverse() * p_us;
  RC_ASSERT(std::abs(p_frame.z()) < kRoundTrip_mm);
  ScanIndex back = ArrayInverse(geometry.array, geometry.axial).scan_from_frame(p_frame);
  RC_ASSERT(std::abs(back.sample - index.sample) < 1e-7);
  RC_ASSERT(std::abs(back.line - index.line) < 1e-7);
  back.frame = index.frame;
  RC_ASSERT((us_from_scan(geometry, back) - p_us).norm() < kRoundTrip_mm);
}

TEST(TrackedGeometry, LinearLinesStartAtTheArrayAndRunAlongY) {
  ScanGeometry geometry;
  geometry.axial = {100, 2.0, 0.5};
  geometry.array = LinearArray{{-4.0, 0.0, 6.0}};
  geometry.motion = TrackedSweep{{Eigen::Isometry3d::Identity()}, {}};
  EXPECT_TRUE(us_from_scan(geometry, {10.0, 2.0, 0.0}).isApprox(Eigen::Vector3d(6.0, 7.0, 0.0)));
}

TEST(TrackedGeometry, HasNoPositionsBetweenFrames) {
  ScanGeometry geometry;
  geometry.axial = {100, 2.0, 0.5};
  geometry.array = LinearArray{{-4.0, 0.0, 6.0}};
  geometry.motion =
      TrackedSweep{{Eigen::Isometry3d::Identity(), Eigen::Isometry3d::Identity()}, {}};
  for (const double frame : {0.5, -1.0, 2.0, 1e300, std::nan("")})
    EXPECT_THROW(us_from_scan(geometry, {0.0, 0.0, frame}), InputError) << frame;
}

// The motor moves while a frame is acquired: the last line is `lines - 1` steps of travel / lines
// behind the first, and the middle of the frame is at the table's angle.
TEST(MotorisedGeometry, FrameTravelSpreadsAFrameOverMotorAngles) {
  MotorSweep sweep{20.0, {0.1, 0.2}, 0.03};
  EXPECT_NEAR(motor_angle_rad(sweep, 3, 0.0, 1.0), 0.10, 1e-15);
  EXPECT_NEAR(motor_angle_rad(sweep, 3, 0.0, 0.0), 0.09, 1e-15);
  EXPECT_NEAR(motor_angle_rad(sweep, 3, 1.0, 2.0), 0.21, 1e-15);
  sweep.frame_travel_rad = -0.03;
  EXPECT_NEAR(motor_angle_rad(sweep, 3, 0.0, 0.0), 0.11, 1e-15);
}

/// The violation that validate() reports for a valid motorised probe after `change`.
std::string violation(const std::function<void(ScanGeometry&)>& change) {
  ScanGeometry geometry;
  geometry.axial = {128, 0.0, 0.6};
  geometry.array = CurvilinearArray{40.0, centred_table(64, 0.0213)};
  geometry.motion = MotorSweep{27.25, centred_table(80, 0.01277), 0.0};
  geometry.validate("sweep.nrrd");  // valid before the change
  change(geometry);
  try {
    geometry.validate("sweep.nrrd");
  } catch (const InputError& error) {
    EXPECT_EQ(error.source(), "sweep.nrrd");
    return error.violation();
  }
  return "accepted";
}

TEST(ScanGeometryValidation, NamesFieldValueAndConstraint) {
  const double nan = std::nan("");
  const auto array = [](ScanGeometry& g) -> CurvilinearArray& {
    return std::get<CurvilinearArray>(g.array);
  };
  const auto sweep = [](ScanGeometry& g) -> MotorSweep& { return std::get<MotorSweep>(g.motion); };
  const std::vector<std::pair<std::function<void(ScanGeometry&)>, std::string>> cases = {
      {[](ScanGeometry& g) { g.axial.samples = 1; }, "has 1 samples per line, must be >= 2"},
      {[](ScanGeometry& g) { g.axial.spacing_mm = -0.3; },
       "'sample_spacing_mm' is -0.3, must be finite and > 0"},
      {[=](ScanGeometry& g) { g.axial.spacing_mm = nan; },
       "'sample_spacing_mm' is nan, must be finite and > 0"},
      {[](ScanGeometry& g) { g.axial.start_depth_mm = -1.0; },
       "'start_depth_mm' is -1, must be finite and >= 0"},
      {[=](ScanGeometry& g) { array(g).probe_radius_mm = 0.0; },
       "'probe_radius_mm' is 0, must be finite and > 0"},
      {[=](ScanGeometry& g) { array(g).line_angles_rad = {0.0}; },
       "'line_angles_rad' has 1 entries, must have at least 2"},
      {[=](ScanGeometry& g) {
         array(g).line_angles_rad = {0.0, 95.0 * kDegree};
       },
       "'line_angles_rad' entry 1 is 95.000000 degrees, must be within +-90 degrees"},
      {[=](ScanGeometry& g) { sweep(g).motor_radius_mm = -27.0; },
       "'motor_radius_mm' is -27, must be finite and > 0"},
      {[=](ScanGeometry& g) {
         sweep(g).frame_angles_rad = {0.0, 0.1, 0.1};
       },
       "'frame_angles_rad' entry 2 is 0.100000 after 0.100000, must be strictly rising or strictly "
       "falling"},
      {[=](ScanGeometry& g) { sweep(g).frame_travel_rad = nan; },
       "'frame_travel_rad' is not finite"},
      {[=](ScanGeometry& g) {
         sweep(g).frame_angles_rad = {0.0, 80.0 * kDegree};
         sweep(g).frame_travel_rad = -30.0 * kDegree;
       },
       "'frame_angles_rad' entry 1 is 80.000000 degrees, with half the frame's travel of 15.000000 "
       "degrees, must be within +-90 degrees"},
      {[](ScanGeometry& g) {
         g.array = LinearArray{{0.0, 1.0}};
       },
       "a motorised probe has a linear array, must be curvilinear"},
      {[](ScanGeometry& g) { g.motion = TrackedSweep{}; }, "has no frames, must have at least 1"},
  };
  for (const auto& [change, expected] : cases) EXPECT_EQ(violation(change), expected);
}

// Beyond the motor axis two motor angles reach the same point: such a sweep has no inverse.
TEST(ScanGeometryValidation, RefusesLinesThatStartBehindTheMotorAxis) {
  const std::string message = violation([](ScanGeometry& g) {
    std::get<CurvilinearArray>(g.array).line_angles_rad = {-60.0 * kDegree, 60.0 * kDegree};
    std::get<MotorSweep>(g.motion).motor_radius_mm = 19.0;  // axis at 21 mm, lines start at 20 mm
  });
  EXPECT_NE(message.find("'motor_radius_mm' is 19.0"), std::string::npos) << message;
  EXPECT_NE(message.find("must be > 20.0"), std::string::npos) << message;
  EXPECT_EQ(
      violation([](ScanGeometry& g) {
        std::get<CurvilinearArray>(g.array).line_angles_rad = {-60.0 * kDegree, 60.0 * kDegree};
        std::get<MotorSweep>(g.motion).motor_radius_mm = 20.1;
      }),
      "accepted");
}

TEST(ScanGeometryValidation, RefusesPosesThatAreNotRigidAndTimesThatFall) {
  const auto tracked = [](const TrackedSweep& sweep) {
    return violation([&](ScanGeometry& g) { g.motion = sweep; });
  };
  Eigen::Isometry3d scaled = Eigen::Isometry3d::Identity();
  scaled.linear() *= 1.01;
  Eigen::Isometry3d mirrored = Eigen::Isometry3d::Identity();
  mirrored.linear()(0, 0) = -1.0;
  Eigen::Isometry3d infinite = Eigen::Isometry3d::Identity();
  infinite.translation().x() = std::numeric_limits<double>::infinity();
  const Eigen::Isometry3d good = Eigen::Isometry3d::Identity();
  for (const Eigen::Isometry3d& bad : {scaled, mirrored, infinite})
    EXPECT_EQ(tracked({{good, bad}, {}}),
              "'frame_poses_mm' of frame 1 is not a rotation and a finite translation");
  EXPECT_EQ(tracked({{good, good}, {0.0}}),
            "'frame_times_s' has 1 entries for 2 frames, must have one per frame");
  EXPECT_EQ(tracked({{good, good}, {1.0, 0.5}}),
            "'frame_times_s' entry 1 is 0.500000, must be finite and not falling");
  EXPECT_EQ(tracked({{good, good}, {1.0, 1.0}}), "accepted");  // duplicate frames are common
}

}  // namespace
}  // namespace usct
