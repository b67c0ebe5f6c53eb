#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <boost/make_shared.hpp>
#include <chrono>
#include <future>
#include <thread>

#include "ros/conversions/ct.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "ros/held_volumes.h"
#include "ros/tf_buffer.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using msg::Acquisition;
using Status = msg::StatusCode;
using testing::HasSubstr;

bool never() { return false; }

const ::ros::Time kNow(200.0);

std_msgs::Header header(const std::string& frame, double seconds) {
  std_msgs::Header header;
  header.frame_id = frame;
  header.stamp = ::ros::Time(seconds);
  return header;
}

boost::shared_ptr<msg::PreScanVolume> ultrasound_message(double seconds) {
  PreScanVolume volume;
  volume.geometry.axial = {2, 3.0, 0.4};
  volume.geometry.array = CurvilinearArray{40.0, {-0.1, 0.1}};
  volume.geometry.motion = MotorSweep{27.25, {-0.2, 0.2}, 0.0};
  volume.voxels.assign(8, 50);
  return boost::make_shared<msg::PreScanVolume>(to_message(volume, header("us", seconds)));
}

boost::shared_ptr<msg::CtVolume> ct_message(unsigned revision) {
  CtVolume ct;
  ct.grid.size = {2, 2, 2};
  ct.grid.spacing_mm = {1.0, 1.0, 1.0};
  ct.voxels.assign(8, static_cast<std::int16_t>(revision));
  return boost::make_shared<msg::CtVolume>(to_message(ct, header("ct", 10.0), revision));
}

class HeldVolumesTest : public testing::Test {
 protected:
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

TEST_F(HeldVolumesTest, NothingIsHeldAtFirst) {
  EXPECT_EQ(ct_refusal().code(), Status::NO_CT);
  EXPECT_EQ(ultrasound_refusal().code(), Status::NO_ULTRASOUND);
  EXPECT_EQ(volumes().ready_ultrasound().number, 0U);
}

TEST_F(HeldVolumesTest, WhoAsksGetsWhatArrivedBefore) {
  for (int i = 1; i <= 50; ++i) {
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(i)), kNow);
    volumes().arrived(msg::CtVolume::ConstPtr(ct_message(static_cast<unsigned>(i))), kNow);
    EXPECT_EQ(newest_s(), i);
    EXPECT_EQ(volumes().ct(never)->revision, static_cast<unsigned>(i));
    EXPECT_EQ(volumes().ct(never)->volume.voxels.front(), i);
  }
}

TEST_F(HeldVolumesTest, RecentUltrasoundIsKeptByStamp) {
  options_.ultrasound_volumes = 3;
  for (int i = 1; i <= 5; ++i) {
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(i)), kNow);
    newest_s();
  }
  for (const double kept : {3.0, 4.0, 5.0})
    EXPECT_EQ(volumes().ultrasound(::ros::Time(kept), never)->header.stamp.toSec(), kept);
  const Refusal gone = ultrasound_refusal(2.0);
  EXPECT_EQ(gone.code(), Status::NO_ULTRASOUND);
  EXPECT_THAT(gone.what(), HasSubstr("2.000"));
  EXPECT_THAT(gone.what(), HasSubstr("3.000, 4.000, 5.000"));
}

/// Volumes that come faster than they are converted are dropped; whoever asks still gets none that
/// is older than the newest of that moment.
TEST_F(HeldVolumesTest, VolumesThatAreDroppedDoNotCountAsConverted) {
  options_.ultrasound_volumes = 3;
  // The converting thread outlives the test's body.
  const auto is_held_up = std::make_shared<std::atomic<bool>>(true);
  const auto changes = std::make_shared<std::atomic<int>>(0);
  volumes_.emplace(frame_, options_, [is_held_up, changes] {
    ++*changes;
    while (*is_held_up) std::this_thread::yield();
  });
  const auto arrive = [&](int stamp) {
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(stamp)), kNow);
  };
  arrive(1);
  while (*changes == 0) std::this_thread::yield();  // from now on the converting thread waits
  for (const int stamp : {2, 3, 4}) arrive(stamp);
  std::atomic<bool> waits{false};
  auto asking = std::async(std::launch::async, [&] {
    return volumes()
        .ultrasound(::ros::Time(),
                    [&] {
                      waits = true;
                      return false;
                    })
        ->header.stamp.toSec();
  });
  while (!waits) std::this_thread::yield();
  for (const int stamp : {5, 6, 7}) arrive(stamp);
  EXPECT_EQ(asking.wait_for(std::chrono::milliseconds(100)), std::future_status::timeout);
  *is_held_up = false;
  EXPECT_GE(asking.get(), 5.0);
  EXPECT_EQ(newest_s(), 7.0);
}

TEST_F(HeldVolumesTest, WhoNamesAVolumeThatIsOnItsWayGetsIt) {
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(1)), kNow);
  std::atomic<bool> asked{false};
  auto asking = std::async(std::launch::async, [&] {
    asked = true;
    return volumes().ultrasound(::ros::Time(2.0), never)->header.stamp.toSec();
  });
  while (!asked) std::this_thread::yield();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(2)), kNow);
  EXPECT_EQ(asking.get(), 2.0);
  // It never comes.
  EXPECT_THAT(ultrasound_refusal(3.0).what(), HasSubstr("3.000 is held; there is: 1.000, 2.000"));
}

TEST_F(HeldVolumesTest, TheNewestIsTheOneThatWasAnnounced) {
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(1)), kNow);
  announce(Acquisition::RECORDED, 1.0);  // it came later than its volume
  EXPECT_EQ(newest_s(), 1.0);
  announce(Acquisition::RECORDED, 2.0);
  auto asking = std::async(std::launch::async, [&] { return newest_s(); });
  EXPECT_EQ(asking.wait_for(std::chrono::milliseconds(100)), std::future_status::timeout);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(2)), kNow);
  EXPECT_EQ(asking.get(), 2.0);

  announce(Acquisition::RECORDED, 1.0);  // that of an older volume, too late
  EXPECT_EQ(newest_s(), 2.0);

  announce(Acquisition::RECORDED, 3.0);  // it is lost
  const Refusal lost = ultrasound_refusal();
  EXPECT_EQ(lost.code(), Status::NO_ULTRASOUND);
  EXPECT_THAT(lost.what(), HasSubstr("3.000 was announced, but has not arrived"));
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(4)), kNow);
  EXPECT_EQ(newest_s(), 4.0);
}

/// The patient may have moved before it was acquired.
TEST_F(HeldVolumesTest, UltrasoundFromBeforeARefusedSweepIsNotTheNewest) {
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(1)), kNow);
  announce(Acquisition::REFUSED, 2.0, "12 of 81 frames are missing");
  for (int times = 0; times < 2; ++times) {
    const Refusal refused = ultrasound_refusal();
    EXPECT_EQ(refused.code(), Status::NO_ULTRASOUND);
    EXPECT_THAT(refused.what(), HasSubstr("12 of 81 frames are missing"));
  }
  EXPECT_EQ(volumes().ultrasound(::ros::Time(1.0), never)->header.stamp.toSec(), 1.0);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(3)), kNow);
  EXPECT_EQ(newest_s(), 3.0);
}

TEST_F(HeldVolumesTest, ASweepThatIsRecordedIsWaitedFor) {
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(1)), kNow);
  announce(Acquisition::RECORDING, 2.0);
  auto asking = std::async(std::launch::async, [&] { return newest_s(); });
  EXPECT_EQ(asking.wait_for(std::chrono::milliseconds(100)), std::future_status::timeout);
  announce(Acquisition::RECORDED, 3.0, "", kNow, last_id_);
  announce(Acquisition::RECORDING, 3.1);  // the probe sweeps on and on
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(3)), kNow);
  EXPECT_EQ(asking.get(), 3.0);
  // This one does not end soon.
  EXPECT_THAT(ultrasound_refusal().what(), HasSubstr("recorded since 3.100 s and has not ended"));
}

TEST_F(HeldVolumesTest, WhoWaitsForASweepLearnsThatItIsRefused) {
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(1)), kNow);
  announce(Acquisition::RECORDING, 2.0);
  auto asking =
      std::async(std::launch::async, [&] { return std::string(ultrasound_refusal().what()); });
  EXPECT_EQ(asking.wait_for(std::chrono::milliseconds(100)), std::future_status::timeout);
  announce(Acquisition::REFUSED, 3.0, "the motor turns back");
  EXPECT_THAT(asking.get(), HasSubstr("the motor turns back"));
}

/// The images of a sweep may wait for their poses while the next sweep is recorded, or refused.
TEST_F(HeldVolumesTest, AnEarlierSweepThatIsPlacedLateIsNotTheNewest) {
  for (const std::uint8_t state : {Acquisition::RECORDING, Acquisition::REFUSED}) {
    volumes_.reset();
    announce(Acquisition::RECORDING, 1.0);
    const std::uint64_t first = last_id_;
    announce(state, 3.0, "too long");
    announce(Acquisition::RECORDED, 2.0, "", kNow, first);
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(2)), kNow);
    EXPECT_THAT(ultrasound_refusal().what(), HasSubstr("may show another place"));
  }
}

/// As those of a folder, each of which begins when it is read.
TEST_F(HeldVolumesTest, FilesNeedNotComeInTheOrderOfTheirStamps) {
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), kNow);
  announce(Acquisition::REFUSED, 150.0, "unreadable");
  EXPECT_THAT(ultrasound_refusal().what(), HasSubstr("unreadable"));
  announce(Acquisition::RECORDED, 50.0);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(50)), kNow);
  EXPECT_EQ(newest_s(), 50.0);
}

/// As in each loop of a bag. The first that learns of the jump may be the announcement itself.
TEST_F(HeldVolumesTest, AfterTimeRanBackTheAnnouncedVolumeIsWaitedFor) {
  for (const bool was_noticed : {true, false}) {
    volumes_.reset();
    announce(Acquisition::RECORDED, 101.0, "", ::ros::Time(100.0));  // it is lost
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), ::ros::Time(100.0));
    if (was_noticed) {
      volumes().notice_time(::ros::Time(10.0));
      EXPECT_EQ(newest_s(), 100.0);
    }
    announce(Acquisition::RECORDED, 12.0, "", ::ros::Time(12.0));
    auto newest = std::async(std::launch::async, [&] { return newest_s(); });
    auto named = std::async(std::launch::async, [&] {
      return volumes().ultrasound(::ros::Time(12.0), never)->header.stamp.toSec();
    });
    EXPECT_EQ(newest.wait_for(std::chrono::milliseconds(100)), std::future_status::timeout);
    EXPECT_EQ(named.wait_for(std::chrono::milliseconds(0)), std::future_status::timeout);
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(12)), ::ros::Time(12.0));
    EXPECT_EQ(newest.get(), 12.0);
    EXPECT_EQ(named.get(), 12.0);
  }
}

TEST_F(HeldVolumesTest, MalformedUltrasoundHidesOlderOneUntilTheNext) {
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(1)), kNow);
  auto bad = ultrasound_message(2);
  bad->samples = 4000000000U;
  volumes().arrived(msg::PreScanVolume::ConstPtr(bad), kNow);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(ultrasound_refusal().code(), Status::INVALID_MESSAGE);
    EXPECT_THAT(ultrasound_refusal().what(), HasSubstr("'samples' is 4000000000"));
  }
  EXPECT_EQ(ultrasound_refusal(1.0).code(), Status::OK);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(3)), kNow);
  EXPECT_EQ(newest_s(), 3.0);
}

TEST_F(HeldVolumesTest, UltrasoundWithoutStampOrFrameIsMalformed) {
  auto no_stamp = ultrasound_message(1);
  no_stamp->header.stamp = ::ros::Time();
  volumes().arrived(msg::PreScanVolume::ConstPtr(no_stamp), kNow);
  EXPECT_THAT(ultrasound_refusal().what(), HasSubstr("'header.stamp'"));
  auto no_frame = ultrasound_message(2);
  no_frame->header.frame_id = "";
  volumes().arrived(msg::PreScanVolume::ConstPtr(no_frame), kNow);
  EXPECT_THAT(ultrasound_refusal().what(), HasSubstr("'header.frame_id'"));
}

TEST_F(HeldVolumesTest, MalformedCtHidesOlderOne) {
  volumes().arrived(msg::CtVolume::ConstPtr(ct_message(1)), kNow);
  const auto first = volumes().ct(never);
  auto bad = ct_message(2);
  bad->data[3] ^= 1;
  volumes().arrived(msg::CtVolume::ConstPtr(bad), kNow);
  EXPECT_EQ(ct_refusal().code(), Status::INVALID_MESSAGE);
  EXPECT_THAT(ct_refusal().what(), HasSubstr("revision 2"));
  EXPECT_FALSE(volumes().is_newest(*first));
  volumes().arrived(msg::CtVolume::ConstPtr(ct_message(3)), kNow);
  EXPECT_EQ(volumes().ct(never)->revision, 3U);
}

TEST_F(HeldVolumesTest, CtIsNewestUntilAnotherArrives) {
  volumes().arrived(msg::CtVolume::ConstPtr(ct_message(1)), kNow);
  const auto first = volumes().ct(never);
  EXPECT_TRUE(volumes().is_newest(*first));
  volumes().arrived(msg::CtVolume::ConstPtr(ct_message(1)), kNow);  // sent again
  EXPECT_TRUE(volumes().is_newest(*first));
  volumes().arrived(msg::CtVolume::ConstPtr(ct_message(2)), kNow);
  EXPECT_FALSE(volumes().is_newest(*first));
  // A ct_server on another machine, or in a loop of a bag, may count its revisions anew.
  auto other = ct_message(3);
  other->revision = 1;
  volumes().arrived(msg::CtVolume::ConstPtr(other), kNow);
  EXPECT_FALSE(volumes().is_newest(*first));
}

TEST_F(HeldVolumesTest, StampsFarAheadOfTheClockAreRefused) {
  auto us = ultrasound_message(1);
  us->header.stamp = ::ros::Time(4294967200U, 0);
  volumes().arrived(msg::PreScanVolume::ConstPtr(us), kNow);
  EXPECT_EQ(ultrasound_refusal().code(), Status::INVALID_MESSAGE);
  EXPECT_THAT(ultrasound_refusal().what(), HasSubstr("'header.stamp' is 4294967200.000 s"));
  auto ct = ct_message(1);
  ct->header.stamp = ::ros::Time(4294967200U, 0);
  volumes().arrived(msg::CtVolume::ConstPtr(ct), kNow);
  EXPECT_EQ(ct_refusal().code(), Status::INVALID_MESSAGE);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(229.0)), kNow);
  EXPECT_EQ(newest_s(), 229.0) << "clocks may differ a little";
}

TEST_F(HeldVolumesTest, FrameStampsMustBeWithinTheAcquisition) {
  for (const std::vector<double>& stamps :
       {std::vector<double>{0.0, 9.0}, {9.0, 8.0}, {9.0, 10.5}, {9.0}}) {
    auto us = ultrasound_message(10);
    for (const double stamp : stamps) us->frame_stamps.emplace_back(stamp);
    volumes().arrived(msg::PreScanVolume::ConstPtr(us), kNow);
    EXPECT_EQ(ultrasound_refusal().code(), Status::INVALID_MESSAGE);
    EXPECT_THAT(ultrasound_refusal().what(), HasSubstr("frame_stamps"));
  }
}

/// A refusal says which ultrasound is refused.
TEST_F(HeldVolumesTest, RefusedUltrasoundHasItsHeader) {
  auto bad = ultrasound_message(7);
  bad->crc32 ^= 1U;
  volumes().arrived(msg::PreScanVolume::ConstPtr(bad), kNow);
  try {
    volumes().ultrasound(::ros::Time(), never);
    FAIL();
  } catch (const UltrasoundRefusal& refusal) {
    EXPECT_EQ(refusal.header().stamp, ::ros::Time(7.0));
    EXPECT_EQ(refusal.header().frame_id, "us");
  }
}

class CtAndUltrasound : public HeldVolumesTest {
 protected:
  /// The CT whose voxels all have the value `voxels`, loaded at `stamp_s`.
  void load_ct(int voxels, unsigned revision, double stamp_s, double now_s) {
    auto message = ct_message(static_cast<unsigned>(voxels));
    message->revision = revision;
    message->header.stamp = ::ros::Time(stamp_s);
    volumes().arrived(msg::CtVolume::ConstPtr(message), ::ros::Time(now_s));
    ct_ = volumes().ct(never);
  }
  /// Whether ultrasound with this stamp, which arrives now, is older than the CT.
  bool is_outdated(double stamp_s, double now_s) {
    volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(stamp_s)),
                      ::ros::Time(now_s));
    us_ = volumes().ultrasound(::ros::Time(), never);
    return is_older(*us_, *ct_);
  }
  std::shared_ptr<const HeldCt> ct_;
  std::shared_ptr<const HeldUltrasound> us_;
};

TEST_F(CtAndUltrasound, TheSameVoxelsKeepTheirFirstStamp) {
  load_ct(5, 1, 100.0, 100.0);
  EXPECT_TRUE(is_outdated(99.0, 101.0));
  EXPECT_FALSE(is_outdated(102.0, 103.0));
  load_ct(5, 2, 110.0, 110.0);
  EXPECT_EQ(ct_->revision, 2U);
  EXPECT_EQ(ct_->header.stamp, ::ros::Time(100.0));
  EXPECT_FALSE(is_older(*us_, *ct_));
  // In another frame it is another CT: an alignment of the first does not hold for it.
  auto renamed = ct_message(5);
  renamed->revision = 9;
  renamed->header = header("ct_of_last_month", 115.0);
  volumes().arrived(msg::CtVolume::ConstPtr(renamed), ::ros::Time(115.0));
  EXPECT_EQ(volumes().ct(never)->header.stamp, ::ros::Time(115.0));
  // With another CT in between, the ultrasound may be that of the other patient.
  load_ct(6, 3, 120.0, 120.0);
  EXPECT_TRUE(is_older(*us_, *ct_));
  load_ct(5, 4, 130.0, 130.0);
  EXPECT_TRUE(is_older(*us_, *ct_));
}

/// As in each loop of a bag: the CT that was loaded in the first loop is there in all that follow.
TEST_F(CtAndUltrasound, AfterTimeRanBackTheCtWasThereBefore) {
  load_ct(5, 1, 105.0, 105.0);
  EXPECT_FALSE(is_outdated(110.0, 110.0));
  const auto of_first_loop = us_;
  EXPECT_FALSE(is_outdated(103.0, 103.0));
  EXPECT_FALSE(is_older(*of_first_loop, *ct_));
  // Acquired before the clock was set back, and before the CT.
  EXPECT_TRUE(is_outdated(101.0, 103.5));
  // A CT that is loaded after the jump may be of another patient than the ultrasound from before.
  const auto of_second_loop = us_;
  load_ct(6, 2, 100.0, 104.0);
  EXPECT_TRUE(is_older(*of_first_loop, *ct_));
  EXPECT_FALSE(is_older(*of_second_loop, *ct_));
}

/// As of a ct_server that starts again in a later loop of a bag.
TEST_F(CtAndUltrasound, TheSameVoxelsWereThereBeforeTimeRanBack) {
  load_ct(5, 1, 105.0, 105.0);
  EXPECT_FALSE(is_outdated(110.0, 110.0));
  EXPECT_FALSE(is_outdated(103.0, 103.0));
  load_ct(5, 2, 104.0, 104.0);
  EXPECT_FALSE(is_older(*us_, *ct_));
}

/// It was acquired while the CT was there, and arrives only after the clock was set back.
TEST_F(CtAndUltrasound, UltrasoundThatArrivesAfterTheClockWasSetBackMayBeFromBefore) {
  load_ct(5, 1, 100.0, 110.0);
  volumes().notice_time(::ros::Time(103.0));
  EXPECT_FALSE(is_outdated(101.0, 103.2));
  EXPECT_TRUE(is_outdated(99.0, 103.3));
}

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
  options_.tf_timeout_s = 60.0;
  volumes_.emplace(with_tf_, options_, [] {});
  know(99.0, 0.0);
  know(100.02, 0.0);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), kNow);
  const auto found = volumes().ultrasound(::ros::Time(), [] { return false; });
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
  options_.tf_timeout_s = 0.2;
  volumes_.emplace(with_tf_, options_, [] {});
  know(99.0, 0.0);
  know(100.02, 0.0);
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(100)), kNow);
  const auto not_cancelled = [] { return false; };
  const auto found = volumes().ultrasound(::ros::Time(), not_cancelled);
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
