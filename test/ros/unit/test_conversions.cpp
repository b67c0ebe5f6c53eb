#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <functional>
#include <limits>

#include "ros/conversions/ct.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/registration_result.h"
#include "ros/conversions/ultrasound.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using testing::HasSubstr;

constexpr double kDegree = M_PI / 180.0;

PreScanVolume motorised_volume() {
  PreScanVolume volume;
  volume.geometry.axial = {5, 3.0, 0.4};
  volume.geometry.array = CurvilinearArray{40.0, {-0.1, 0.0, 0.1, 0.2}};
  volume.geometry.motion = MotorSweep{27.25, {-0.2, 0.0, 0.3}, 0.01};
  for (int i = 0; i < 60; ++i) volume.voxels.push_back(static_cast<std::uint8_t>(3 * i));
  return volume;
}

PreScanVolume tracked_linear() {
  PreScanVolume volume = motorised_volume();
  volume.geometry.array = LinearArray{{-2.0, -1.0, 1.0, 2.5}};
  TrackedSweep sweep;
  for (int i = 0; i < 3; ++i) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.rotate(Eigen::AngleAxisd(20.0 * kDegree * (i + 1), Eigen::Vector3d(1, 2, 3).normalized()));
    T.translation() = Eigen::Vector3d(10.0 * i, -4.0, 7.0);
    sweep.T_us_frame.push_back(T);
  }
  sweep.frame_times_s = {0.0, 0.5, 1.25};
  volume.geometry.motion = sweep;
  return volume;
}

CtVolume oblique_ct() {
  CtVolume ct;
  ct.grid.size = {4, 3, 2};
  ct.grid.spacing_mm = {0.5, 0.7, 2.0};
  ct.grid.origin_mm = {-120.0, 35.5, 800.25};
  ct.grid.direction =
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 1, 0).normalized()).toRotationMatrix();
  for (int i = 0; i < 24; ++i) ct.voxels.push_back(static_cast<std::int16_t>(100 * i - 1000));
  return ct;
}

template <typename F>
std::string error_of(F&& work) {
  try {
    work();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

std_msgs::Header header() {
  std_msgs::Header h;
  h.stamp = ::ros::Time(100, 250000000);
  h.frame_id = "us";
  return h;
}

TEST(Conversions, MotorisedVolumeIsInMetresAndComesBack) {
  const PreScanVolume volume = motorised_volume();
  const msg::PreScanVolume message = to_message(volume, header());
  EXPECT_NEAR(message.geometry.probe_radius, 0.040, 1e-12);
  EXPECT_NEAR(message.geometry.motor_radius, 0.02725, 1e-12);
  EXPECT_NEAR(message.geometry.start_depth, 0.003, 1e-12);
  EXPECT_NEAR(message.geometry.sample_spacing, 0.0004, 1e-12);
  const PreScanVolume back = from_message(message, "test");
  EXPECT_EQ(back.voxels, volume.voxels);
  for (const ScanIndex index : {ScanIndex{0, 0, 0}, {4, 3, 2}, {1.5, 2.25, 0.5}})
    EXPECT_LT((us_from_scan(back.geometry, index) - us_from_scan(volume.geometry, index)).norm(),
              1e-9);
}

TEST(Conversions, TrackedVolumeKeepsPosesAndTimes) {
  const PreScanVolume volume = tracked_linear();
  const msg::PreScanVolume message = to_message(volume, header());
  ASSERT_EQ(message.frame_poses.size(), 3U);
  EXPECT_NEAR(message.frame_poses[2].position.x, 0.020, 1e-12);
  EXPECT_EQ(message.frame_stamps.back(), header().stamp) << "the stamp is the end of the sweep";
  EXPECT_NEAR((message.frame_stamps[2] - message.frame_stamps[0]).toSec(), 1.25, 1e-9);
  const PreScanVolume back = from_message(message, "test");
  const auto& sweep = std::get<TrackedSweep>(back.geometry.motion);
  EXPECT_NEAR(sweep.frame_times_s[1], 0.5, 1e-9);
  for (int f = 0; f < 3; ++f)
    EXPECT_LT((us_from_scan(back.geometry, {4, 3, static_cast<double>(f)}) -
               us_from_scan(volume.geometry, {4, 3, static_cast<double>(f)}))
                  .norm(),
              1e-9);
}

TEST(Conversions, ObliqueCtComesBack) {
  const CtVolume ct = oblique_ct();
  const msg::CtVolume message = to_message(ct, header(), 7);
  EXPECT_EQ(message.revision, 7U);
  EXPECT_NEAR(message.origin.z, 0.80025, 1e-12);
  EXPECT_NEAR(message.spacing[2], 0.002, 1e-12);
  const CtVolume back = from_message(message, "test");
  EXPECT_TRUE(same_grid(back.grid, ct.grid));
  EXPECT_EQ(back.voxels, ct.voxels);
}

/// The header of a file may be corrected, and its voxels stay.
TEST(Conversions, ACtWithTheSameVoxelsElsewhereIsAnotherOne) {
  const CtVolume ct = oblique_ct();
  const std::uint32_t crc32 = to_message(ct, header(), 1).crc32;
  EXPECT_EQ(to_message(ct, header(), 2).crc32, crc32);
  const auto crc32_with = [&](const std::function<void(Grid&)>& change) {
    CtVolume other = ct;
    change(other.grid);
    return to_message(other, header(), 1).crc32;
  };
  EXPECT_NE(crc32_with([](Grid& grid) { grid.origin_mm.x() += 0.001; }), crc32);
  EXPECT_NE(crc32_with([](Grid& grid) { grid.spacing_mm.z() *= 1.001; }), crc32);
  EXPECT_NE(crc32_with([](Grid& grid) { grid.direction.leftCols<2>() *= -1.0; }), crc32);
  EXPECT_NE(crc32_with([](Grid& grid) { std::swap(grid.size[0], grid.size[1]); }), crc32);
}

TEST(Conversions, AbsurdSizesAreRefusedBeforeAnythingIsAllocated) {
  msg::CtVolume ct = to_message(oblique_ct(), header(), 1);
  ct.size = {2000000000, 2000000000, 2000000000};
  EXPECT_THAT(error_of([&] { from_message(ct, "ct/volume"); }),
              HasSubstr("ct/volume: 'data' has 24 values, must have 2000000000 x"));
  ct.size = {0, 3, 2};
  EXPECT_THAT(error_of([&] { from_message(ct, "ct/volume"); }), HasSubstr("'size[0]' is 0"));
  msg::PreScanVolume us = to_message(motorised_volume(), header());
  us.samples = us.lines = us.frames = 0xffffffffU;
  EXPECT_THAT(error_of([&] { from_message(us, "us/volume"); }),
              HasSubstr("'samples' is 4294967295"));
  us = to_message(motorised_volume(), header());
  us.frames = 4;
  EXPECT_THAT(error_of([&] { from_message(us, "us/volume"); }),
              HasSubstr("'data' has 60 values, must have 5 x 4 x 4"));
}

TEST(Conversions, DamagedVoxelsAreRefused) {
  msg::CtVolume ct = to_message(oblique_ct(), header(), 1);
  ct.data[5] = static_cast<std::int16_t>(ct.data[5] + 1);
  EXPECT_THAT(error_of([&] { from_message(ct, "ct/volume"); }), HasSubstr("checksum"));
  ct = to_message(oblique_ct(), header(), 1);
  ct.origin.y += 1e-6;
  EXPECT_THAT(error_of([&] { from_message(ct, "ct/volume"); }), HasSubstr("checksum"));
  msg::PreScanVolume us = to_message(motorised_volume(), header());
  us.data[59] ^= 1;
  EXPECT_THAT(error_of([&] { from_message(us, "us/volume"); }), HasSubstr("checksum"));
}

TEST(Conversions, WhatTheTypeOfProbeDoesNotHaveIsRefused) {
  msg::PreScanVolume us = to_message(motorised_volume(), header());
  us.frame_poses.resize(3);
  EXPECT_THAT(error_of([&] { from_message(us, "us/volume"); }),
              HasSubstr("'frame_poses' is set, but the type of probe has none"));
  us = to_message(motorised_volume(), header());
  us.geometry.type = 9;
  EXPECT_THAT(error_of([&] { from_message(us, "us/volume"); }),
              HasSubstr("'geometry.type' is 9, must be 1, 2 or 3"));
  us = to_message(tracked_linear(), header());
  us.frame_poses[1].orientation.w = 0.0;
  EXPECT_THAT(error_of([&] { from_message(us, "us/volume"); }), HasSubstr("frame_poses[1]"));
  us = to_message(motorised_volume(), header());
  us.frame_angles[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(error_of([&] { from_message(us, "us/volume"); }), "no error");
}

TEST(Conversions, AnUnsetTransformIsNoRotation) {
  EXPECT_THAT(error_of([] { from_message_mm(geometry_msgs::Transform(), "goal"); }),
              HasSubstr("goal: the quaternion has length 0"));
}

TEST(Conversions, CovarianceChangesOrderAndUnit) {
  RegistrationResult result;
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance(0, 0) = 0.01;                    // rotation about x, rad^2
  covariance(5, 5) = 4.0;                     // z, mm^2
  covariance(0, 5) = covariance(5, 0) = 0.1;  // rad mm
  result.covariance = covariance;
  const msg::RegistrationResult message = to_message(result);
  EXPECT_DOUBLE_EQ(message.covariance[3 * 6 + 3], 0.01);
  EXPECT_DOUBLE_EQ(message.covariance[2 * 6 + 2], 4e-6);
  EXPECT_DOUBLE_EQ(message.covariance[2 * 6 + 3], 1e-4);
  EXPECT_DOUBLE_EQ(message.covariance[3 * 6 + 2], 1e-4);
}

TEST(Conversions, ConfidenceIsInMetresAndNotANumberWhereItIsNotKnown) {
  RegistrationResult result;
  const msg::RegistrationResult unknown = to_message(result);
  EXPECT_TRUE(std::isnan(unknown.wrong_probability));
  EXPECT_TRUE(std::isnan(unknown.expected_error));
  EXPECT_TRUE(std::isnan(unknown.error_bound));
  EXPECT_TRUE(unknown.measures.empty());

  result.measures.wrong_probability = 0.25;
  result.measures.expected_error_mm = 1.5;
  result.measures.error_bound_mm = 2.5;
  const msg::RegistrationResult known = to_message(result);
  EXPECT_DOUBLE_EQ(known.wrong_probability, 0.25);
  EXPECT_DOUBLE_EQ(known.expected_error, 0.0015);
  EXPECT_DOUBLE_EQ(known.error_bound, 0.0025);
  EXPECT_EQ(known.measures.size(), 3U);
}

TEST(Conversions, AResultComesBack) {
  RegistrationResult result;
  result.status = RegistrationStatus::kRegistered;
  result.message = "it fits";
  result.T_us_ct =
      Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 2).normalized());
  result.similarity = 0.7;
  result.overlap = 0.9;
  result.candidates = {{*result.T_us_ct, 0.7, 0.9}, {Eigen::Isometry3d::Identity(), 0.6, 0.8}};
  result.measures.mirror_ratio = 1.5;
  result.measures.expected_error_mm = 1.25;
  const RegistrationResult back = registration_result_from(to_message(result), "result");
  EXPECT_EQ(back.status, result.status);
  EXPECT_EQ(back.message, result.message);
  EXPECT_TRUE(back.T_us_ct->isApprox(*result.T_us_ct, 1e-12));
  EXPECT_EQ(back.similarity, 0.7);
  ASSERT_EQ(back.candidates.size(), 2U);
  EXPECT_EQ(back.candidates[1].overlap, 0.8);
  EXPECT_EQ(by_name(back.measures), by_name(result.measures));

  result.status = RegistrationStatus::kLowConfidence;
  result.T_us_ct.reset();
  const RegistrationResult refused = registration_result_from(to_message(result), "result");
  EXPECT_EQ(refused.status, RegistrationStatus::kLowConfidence);
  EXPECT_FALSE(refused.T_us_ct);
  msg::RegistrationResult no_ct;
  no_ct.status.code = msg::StatusCode::NO_CT;
  EXPECT_EQ(registration_result_from(no_ct, "result").status, RegistrationStatus::kFailed);
}

TEST(Conversions, ARefusedResultHasNoTransform) {
  RegistrationResult result;
  result.status = RegistrationStatus::kLowConfidence;
  const msg::RegistrationResult message = to_message(result);
  EXPECT_EQ(message.status.code, msg::StatusCode::LOW_CONFIDENCE);
  EXPECT_NE(error_of([&] { from_message_mm(message.transform, "result"); }), "no error");
}

}  // namespace
}  // namespace usct::ros_interface
