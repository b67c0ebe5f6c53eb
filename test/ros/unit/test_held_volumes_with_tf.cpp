#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "held_volumes_test.h"
#include "ros/conversions/poses.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using testing::HasSubstr;

class HeldVolumesWithTf : public HeldVolumesTest {
 protected:
  HeldVolumesWithTf() { frame_options_.frame = "patient"; }
  void know(double seconds, double x_mm) {
    geometry_msgs::TransformStamped transform;
    transform.header = header("patient", seconds);
    transform.child_frame_id = "us";
    transform.transform.translation.x = x_mm / kMmPerM;
    transform.transform.rotation.w = 1.0;
    tf_.set_transform(transform, "test");
  }
  /// Ultrasound of this stamp is refused, since tf knows nothing of its frame.
  void refuse_for_want_of_tf(double seconds) {
    options_.tf_timeout_s = 0.01;
    volumes_.emplace(with_tf_, options_, [] {});
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(seconds)), kNow);
    EXPECT_EQ(ultrasound_refusal().code(), Status::TF_UNAVAILABLE);
  }
  /// Ultrasound of 100 s. As far as tf knows by then, the probe stands still.
  std::shared_ptr<const HeldUltrasound> arrived_while_tf_is_still(double tf_timeout_s) {
    options_.tf_timeout_s = tf_timeout_s;
    volumes_.emplace(with_tf_, options_, [] {});
    know(99.0, 0.0);
    know(100.02, 0.0);
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), kNow);
    return volumes().ultrasound(::ros::Time(), [] { return false; });
  }
  FixedFrame with_tf_{tf_, [] {
                        FixedFrameOptions options;
                        options.frame = "patient";
                        options.sweep_duration_s = 0.5;
                        return options;
                      }()};
};

TEST_F(HeldVolumesWithTf, WaitsForTfThenHasThePose) {
  options_.tf_timeout_s = 60.0;
  volumes_.emplace(with_tf_, options_, [] {});
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), kNow);
  int asked = 0;
  const auto late = [&] {
    if (++asked == 3) {
      know(99.0, 12.0);
      know(101.0, 12.0);
    }
    return false;
  };
  const auto found = volumes().ultrasound(::ros::Time(), late);
  EXPECT_NEAR(found->pose.T_fixed_us.translation().x(), 12.0, 1e-9);
  EXPECT_GE(asked, 3);
}

/// A caller who names a volume must not get another one.
TEST_F(HeldVolumesWithTf, ANamedVolumeThatIsGivenUpWhileItWaitsForTfIsRefused) {
  options_.tf_timeout_s = 60.0;
  options_.ultrasound_volumes = 1;
  volumes_.emplace(with_tf_, options_, [] {});
  for (const int stamp : {100, 101})
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(stamp)), kNow);
  std::atomic<int> asked{0};
  auto refused = std::async(std::launch::async, [&] {
    return refusal([&] {
      volumes().ultrasound(::ros::Time(101.0), [&] {
        ++asked;
        return false;
      });
    });
  });
  while (asked < 3) std::this_thread::yield();
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(102)), kNow);
  EXPECT_EQ(ultrasound_refusal(1.0).code(), Status::NO_ULTRASOUND);  // once it is converted
  know(99.0, 12.0);
  know(103.0, 12.0);
  const Refusal answer = refused.get();
  EXPECT_EQ(answer.code(), Status::NO_ULTRASOUND);
  EXPECT_THAT(answer.what(), HasSubstr("101.000"));
}

TEST_F(HeldVolumesWithTf, TfThatNeverComesIsTheReason) {
  refuse_for_want_of_tf(100.0);
  know(98.0, 0.0);
  know(99.0, 0.0);
  EXPECT_EQ(ultrasound_refusal().code(), Status::TF_STALE);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(101)), kNow);
  EXPECT_EQ(ultrasound_refusal().code(), Status::TF_STALE);
}

/// Somebody connects the frames that the refusal names, and asks again.
TEST_F(HeldVolumesWithTf, VolumesThatWereRefusedForWantOfTfAreLookedUpAgain) {
  refuse_for_want_of_tf(100.0);
  know(99.0, 12.0);
  know(101.0, 12.0);
  const auto found = volumes().ultrasound(::ros::Time(), never);
  EXPECT_NEAR(found->pose.T_fixed_us.translation().x(), 12.0, 1e-9);
  EXPECT_TRUE(volumes().require_still(*found, never));
}

/// The probe may have been elsewhere at this time of the clock before.
TEST_F(HeldVolumesWithTf, VolumesFromBeforeTheClockWasSetBackAreNotLookedUpAgain) {
  refuse_for_want_of_tf(100.0);
  volumes().notice_time(::ros::Time(50.0));
  know(99.0, 12.0);
  know(101.0, 12.0);
  EXPECT_EQ(ultrasound_refusal().code(), Status::TF_UNAVAILABLE);
}

/// The volume is available as soon as tf reaches its stamp; its result waits.
TEST_F(HeldVolumesWithTf, JumpAfterTheStampIsRefusedOnceTfTellsIt) {
  const auto found = arrived_while_tf_is_still(60.0);
  int asked = 0;
  EXPECT_EQ(refusal([&] { volumes().require_still(*found, [&] { return ++asked > 2; }); }).code(),
            Status::CANCELLED);
  asked = 0;
  const auto late = [&] {
    if (++asked == 3) {
      know(100.03, 10.0);
      know(101.0, 10.0);
    }
    return false;
  };
  EXPECT_EQ(refusal([&] { volumes().require_still(*found, late); }).code(), Status::TF_JUMPED);
  EXPECT_GE(asked, 3);
}

TEST_F(HeldVolumesWithTf, TellsWhetherAMotionAfterTheStampWouldHaveBeenSeen) {
  const auto not_cancelled = [] { return false; };
  const auto found = arrived_while_tf_is_still(0.2);
  EXPECT_FALSE(volumes().require_still(*found, not_cancelled));
  // tf may tell a motion of that time only now.
  know(101.0, 0.0);
  EXPECT_TRUE(volumes().require_still(*found, not_cancelled));
  know(100.03, 10.0);
  EXPECT_EQ(refusal([&] { volumes().require_still(*found, not_cancelled); }).code(),
            Status::TF_JUMPED);
}

/// Only tf that was missing may come later: what tf has shown of the probe stays true.
TEST_F(HeldVolumesWithTf, AProbeThatJumpedIsNotLookedUpAgain) {
  options_.tf_timeout_s = 10.0;
  volumes_.emplace(with_tf_, options_, [] {});
  know(98.0, 0.0);
  know(99.97, 0.0);
  know(99.98, 10.0);
  know(101.0, 10.0);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), kNow);
  EXPECT_EQ(ultrasound_refusal().code(), Status::TF_JUMPED);
  tf_.clear();
  know(98.0, 10.0);
  know(101.0, 10.0);
  EXPECT_EQ(ultrasound_refusal().code(), Status::TF_JUMPED);
}

/// The probe is judged while tf knows, also if nobody asks; a request may come much later.
TEST_F(HeldVolumesWithTf, TheProbeIsJudgedThoughTfHasForgottenItSince) {
  options_.tf_timeout_s = 10.0;
  for (const double x_mm : {0.0, 50.0}) {
    tf_.clear();
    volumes_.emplace(with_tf_, options_, [] {});
    know(99.0, 0.0);
    know(100.01, 0.0);
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), kNow);
    const auto found = volumes().ultrasound(::ros::Time(), never);
    know(100.02, x_mm);
    know(101.0, x_mm);
    EXPECT_EQ(found->still.wait_for(std::chrono::seconds(10)), std::future_status::ready);
    know(200.0, x_mm);  // longer after that than tf remembers
    EXPECT_FALSE(tf_.can_transform("patient", "us", found->header.stamp));
    bool was_seen = false;
    const Refusal refused = refusal([&] { was_seen = volumes().require_still(*found, never); });
    EXPECT_EQ(refused.code(), x_mm > 0.0 ? Status::TF_JUMPED : Status::OK) << refused.what();
    EXPECT_EQ(was_seen, x_mm == 0.0);
  }
}

/// Volumes arrive faster than tf, and more than are kept; those that wait longest still become
/// ready.
TEST_F(HeldVolumesWithTf, VolumesThatComeFasterThanTfDoNotStarve) {
  options_.tf_timeout_s = 600.0;
  options_.ultrasound_volumes = 2;
  volumes_.emplace(with_tf_, options_, [] {});
  volumes().arrived(msg::CtVolume::ConstPtr(ct_message(1)), kNow);
  for (int i = 0; i < 20; ++i) {
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100.0 + 0.01 * i)), kNow);
    EXPECT_EQ(ultrasound_refusal(1.0).code(), Status::NO_ULTRASOUND);  // once it is converted
  }
  know(99.0, 0.0);
  know(100.015, 0.0);  // reaches the first two
  while (volumes().ready_ultrasound().number < 2) std::this_thread::yield();
  EXPECT_NEAR(volumes().ready_ultrasound().stamp.toSec(), 100.01, 1e-6);
  know(102.0, 0.0);
  EXPECT_NEAR(newest_s(), 100.19, 1e-6);
}

TEST_F(HeldVolumesWithTf, WaitEndsWhenCancelled) {
  options_.tf_timeout_s = 600.0;
  volumes_.emplace(with_tf_, options_, [] {});
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), kNow);
  int asked = 0;
  const Refusal refused =
      refusal([&] { volumes().ultrasound(::ros::Time(), [&] { return ++asked > 2; }); });
  EXPECT_EQ(refused.code(), Status::CANCELLED);
  EXPECT_EQ(volumes().ready_ultrasound().number, 0U);
}

}  // namespace
}  // namespace usct::ros_interface
