#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "held_volumes_test.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using testing::HasSubstr;

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

}  // namespace
}  // namespace usct::ros_interface
