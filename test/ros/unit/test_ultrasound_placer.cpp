#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "ros/fusion/ultrasound_placer.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// A motorised sweep of two frames, at 100.0 and 100.5 s, and tf that comes later or not at all.
class LatePlace : public testing::Test {
 protected:
  static us_ct_registration::PreScanVolume sweep_of_two() {
    PreScanVolume volume;
    volume.geometry.axial = {2, 3.0, 0.4};
    volume.geometry.array = CurvilinearArray{40.0, {-0.1, 0.1}};
    volume.geometry.motion = MotorSweep{27.25, {-0.2, 0.2}, 0.0};
    volume.voxels.assign(8, 50);
    std_msgs::Header header;
    header.frame_id = "us";
    header.stamp = ::ros::Time(100.5);
    us_ct_registration::PreScanVolume message = to_message(volume, header);
    message.frame_stamps = {::ros::Time(100.0), ::ros::Time(100.5)};
    return message;
  }
  void know_us(double seconds, double x_mm) {
    tf_.set_transform(
        stamped_transform(::ros::Time(seconds), Eigen::Isometry3d(Eigen::Translation3d(x_mm, 0, 0)),
                          "patient", "us"),
        "test");
  }
  static bool is_tracked(const FusionUltrasound& us) {
    return std::holds_alternative<TrackedSweep>(us.volume.geometry.motion);
  }

  TfBuffer tf_{::ros::Duration(60.0)};
  UltrasoundPlacer placer_{tf_, {"patient", 0.0}};
};

TEST_F(LatePlace, IsThatOfTfOnceItComes) {
  const auto unplaced = placer_.take(sweep_of_two());
  EXPECT_FALSE(unplaced->T_fixed_us);
  EXPECT_THAT(unplaced->warning, HasSubstr("the pose of the probe is not known"));
  EXPECT_EQ(placer_.place_again(), nullptr);
  // The probe moves during the sweep, and its later poses come first.
  know_us(100.4, 18.0);
  know_us(100.6, 22.0);
  const auto half = placer_.place_again();
  ASSERT_NE(half, nullptr);
  EXPECT_NEAR(half->T_fixed_us->translation().x(), 20.0, 1e-6);
  EXPECT_THAT(half->warning, HasSubstr("a motion during the sweep would not be seen"));
  EXPECT_FALSE(is_tracked(*half));
  EXPECT_EQ(placer_.place_again(), nullptr);
  know_us(99.9, 0.0);
  const auto placed = placer_.place_again();
  ASSERT_NE(placed, nullptr);
  EXPECT_NEAR(placed->T_fixed_us->translation().x(), 20.0, 1e-6);
  EXPECT_THAT(placed->warning, IsEmpty());
  EXPECT_TRUE(is_tracked(*placed));
  EXPECT_EQ(placer_.place_again(), nullptr);
}

TEST_F(LatePlace, IsAskedForOnlyWhereTfIsNeeded) {
  know_us(100.0, 0.0);
  know_us(100.5, 0.0);
  EXPECT_THAT(placer_.take(sweep_of_two())->warning, IsEmpty());
  EXPECT_EQ(placer_.place_again(), nullptr);
  UltrasoundPlacer without_frame(tf_, {"", 0.0});
  EXPECT_EQ(without_frame.take(sweep_of_two())->fixed_frame, "us");
  EXPECT_EQ(without_frame.place_again(), nullptr);
  us_ct_registration::PreScanVolume invalid = sweep_of_two();
  invalid.data.pop_back();
  EXPECT_THROW(placer_.take(invalid), InputError);
}

}  // namespace
}  // namespace usct::ros_interface
