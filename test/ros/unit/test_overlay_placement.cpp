#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/conversions/poses.h"
#include "ros/node/refusal.h"
#include "ros/overlay/overlay_placement.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {
namespace {

using Status = us_ct_registration::StatusCode;
using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

const Isometry3d kPatientCt(Translation3d(250, -20, 30) *
                            AngleAxisd(0.7, Vector3d(1.0, 2.0, 2.0) / 3.0));

/// The CT is where the alignment has it, and the camera moves along x by 10 mm in a second.
class OverlayPlacement : public testing::Test {
 protected:
  OverlayPlacement() {
    scene_.fixed_frame = "patient";
    scene_.ct_frame = "ct";
    scene_.T_fixed_ct = kPatientCt;
    for (int i = 0; i <= 20; ++i) {
      know(100.0 + 0.1 * i, camera(i), "camera");
      know(100.0 + 0.1 * i, kPatientCt, "ct");
    }
  }
  static Isometry3d camera(double x_mm) {
    return Translation3d(x_mm, 5, -80) * AngleAxisd(0.3, Vector3d::UnitY());
  }
  void know(double seconds, const Isometry3d& T_patient_child, const std::string& child) {
    tf_.set_transform(stamped_transform(::ros::Time(seconds), T_patient_child, "patient", child),
                      "test");
  }
  Isometry3d placed(const std::string& frame, double stamp_s, double now_s = 102.0) const {
    return T_frame_ct_at(tf_, scene_, frame, ::ros::Time(stamp_s), ::ros::Time(now_s), 0.0);
  }
  int code(const std::string& frame, double stamp_s, double now_s = 102.0) const {
    try {
      placed(frame, stamp_s, now_s);
    } catch (const Refusal& refusal) {
      return refusal.code();
    }
    return Status::OK;
  }

  TfBuffer tf_{::ros::Duration(600.0)};
  OverlayScene scene_;
};

TEST_F(OverlayPlacement, IsThatAtTheStampOfTheImage) {
  for (const double stamp_s : {100.5, 101.2}) {
    const Isometry3d expected = camera(10.0 * (stamp_s - 100.0)).inverse() * kPatientCt;
    EXPECT_TRUE(placed("camera", stamp_s).isApprox(expected, 1e-6)) << stamp_s;
  }
}

TEST_F(OverlayPlacement, ThereIsNoneWithoutStampOrFrameOrTf) {
  EXPECT_EQ(code("camera", 0.0), Status::INVALID_MESSAGE);
  EXPECT_EQ(code("", 101.0), Status::INVALID_MESSAGE);
  EXPECT_EQ(code("camera", 102.1), Status::TF_UNAVAILABLE);
  EXPECT_EQ(code("camera", 99.9), Status::TF_UNAVAILABLE);
  EXPECT_EQ(code("elsewhere", 101.0), Status::TF_UNAVAILABLE);
  // tf may have such transforms as well, where their sender's clock is wrong.
  know(140.0, camera(20.0), "camera");
  know(140.0, kPatientCt, "ct");
  EXPECT_EQ(code("camera", 140.0, 102.0), Status::INVALID_MESSAGE);
  EXPECT_EQ(code("camera", 140.0, 120.0), Status::OK);
}

TEST_F(OverlayPlacement, ThereIsNoneWhereTfHasTheCtElsewhere) {
  const Isometry3d shift(Translation3d(0.0, 0.0, 0.01));
  const Isometry3d turn(AngleAxisd(1e-4, Vector3d::UnitX()));
  for (const Isometry3d& moved : {shift, turn}) {
    scene_.T_fixed_ct = kPatientCt * moved;
    EXPECT_EQ(code("camera", 101.0), Status::TF_STALE);
  }
  scene_.T_fixed_ct = kPatientCt;
  EXPECT_EQ(code("camera", 101.0), Status::OK);
}

}  // namespace
}  // namespace usct::ros_interface
