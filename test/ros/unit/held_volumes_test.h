#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <optional>
#include <string>

#include "ros/conversions/ct.h"
#include "ros/conversions/ultrasound.h"
#include "ros/registration/held_volumes.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {

/// Volumes of 2 x 2 x 2 values that HeldVolumes gets.
class HeldVolumesTest : public testing::Test {
 protected:
  using Acquisition = us_ct_registration::Acquisition;
  using Status = us_ct_registration::StatusCode;
  using CtMessage = us_ct_registration::CtVolume;
  using UltrasoundMessage = us_ct_registration::PreScanVolume;

  static bool never() { return false; }

  static inline const ::ros::Time kNow{200.0};

  static std_msgs::Header header(const std::string& frame, double seconds) {
    std_msgs::Header header;
    header.frame_id = frame;
    header.stamp = ::ros::Time(seconds);
    return header;
  }

  static boost::shared_ptr<UltrasoundMessage> ultrasound_message(double seconds) {
    PreScanVolume volume;
    volume.geometry.axial = {2, 3.0, 0.4};
    volume.geometry.array = CurvilinearArray{40.0, {-0.1, 0.1}};
    volume.geometry.motion = MotorSweep{27.25, {-0.2, 0.2}, 0.0};
    volume.voxels.assign(8, 50);
    return boost::make_shared<UltrasoundMessage>(to_message(volume, header("us", seconds)));
  }

  static boost::shared_ptr<CtMessage> ct_message(unsigned revision) {
    CtVolume ct;
    ct.grid.size = {2, 2, 2};
    ct.grid.spacing_mm = {1.0, 1.0, 1.0};
    ct.voxels.assign(8, static_cast<std::int16_t>(revision));
    return boost::make_shared<CtMessage>(to_message(ct, header("ct", 10.0), revision));
  }

  HeldVolumes& volumes() {
    if (!volumes_) volumes_.emplace(frame_, options_, [] {});
    return *volumes_;
  }
  template <typename Ask>
  Refusal refusal(Ask&& ask) {
    try {
      ask();
    } catch (const Refusal& refusal) {
      return refusal;
    }
    return {Status::OK, "no refusal"};
  }
  Refusal ct_refusal() {
    return refusal([&] { volumes().ct(never); });
  }
  Refusal ultrasound_refusal(double seconds = 0.0) {
    return refusal([&] { volumes().ultrasound(::ros::Time(seconds), never); });
  }
  void announce(std::uint8_t state, double seconds, const std::string& reason = {},
                const ::ros::Time& now = kNow, std::uint64_t id = 0) {
    Acquisition acquisition;
    acquisition.header.stamp = ::ros::Time(seconds);
    acquisition.id = id == 0 ? ++last_id_ : id;
    acquisition.state = state;
    acquisition.reason = reason;
    volumes().announced(acquisition, now);
  }
  double newest_s() { return volumes().ultrasound(::ros::Time(), never)->header.stamp.toSec(); }

  std::uint64_t last_id_ = 0;  // of an acquisition
  FixedFrameOptions frame_options_;
  HeldVolumesOptions options_;
  TfBuffer tf_{::ros::Duration(60.0)};
  FixedFrame frame_{tf_, frame_options_};
  std::optional<HeldVolumes> volumes_;
};

}  // namespace usct::ros_interface
