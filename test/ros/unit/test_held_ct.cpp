#include <chrono>
#include <future>

#include "held_volumes_test.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using testing::HasSubstr;

class HeldCtTest : public HeldVolumesTest {
 protected:
  void arrive(unsigned revision) {
    volumes().arrived(msg::CtVolume::ConstPtr(ct_message(revision)), kNow);
  }
  void announce_ct(unsigned revision) {
    const auto volume = ct_message(revision);
    msg::CtInfo info;
    info.header = volume->header;
    info.revision = volume->revision;
    info.crc32 = volume->crc32;
    volumes().announced(info);
  }
  unsigned held_revision() { return volumes().ct(never)->revision; }
};

TEST_F(HeldCtTest, WhoAsksWaitsForTheCtThatWasAnnounced) {
  for (const bool is_another_held : {false, true}) {
    volumes_.reset();
    if (is_another_held) arrive(1);
    announce_ct(2);
    auto asking = std::async(std::launch::async, [&] { return held_revision(); });
    EXPECT_EQ(asking.wait_for(std::chrono::milliseconds(100)), std::future_status::timeout);
    volumes().notice_time(::ros::Time(100.0));  // a bag begins again
    EXPECT_EQ(asking.wait_for(std::chrono::milliseconds(50)), std::future_status::timeout);
    arrive(2);
    EXPECT_EQ(asking.get(), 2U);
  }
}

TEST_F(HeldCtTest, ACtThatWasAnnouncedAndDoesNotComeIsTheReason) {
  options_.ct_patience_s = 0.2;
  arrive(1);
  announce_ct(2);
  const Refusal lost = ct_refusal();
  EXPECT_EQ(lost.code(), Status::NO_CT);
  EXPECT_THAT(lost.what(), HasSubstr("CT revision 2 was announced, but has not arrived"));
  ASSERT_TRUE(volumes().state().ct_refusal);
  EXPECT_THAT(volumes().state().ct_refusal->what(), HasSubstr("has not arrived"));
  arrive(3);
  EXPECT_EQ(held_revision(), 3U);
  EXPECT_FALSE(volumes().state().ct_refusal);
}

TEST_F(HeldCtTest, ACtIsNoLongerTheNewestOnceAnotherIsAnnounced) {
  EXPECT_FALSE(volumes().newest_ct());
  arrive(1);
  const auto first = volumes().ct(never);
  EXPECT_EQ(volumes().newest_ct(), identity_of(*first));
  announce_ct(1);
  EXPECT_TRUE(volumes().is_newest(*first));
  announce_ct(2);
  EXPECT_FALSE(volumes().is_newest(*first));
  EXPECT_EQ(volumes().newest_ct(), CtIdentity("ct", ct_message(2)->crc32));
  arrive(2);
  EXPECT_EQ(volumes().newest_ct(), identity_of(*volumes().ct(never)));
  auto bad = ct_message(3);
  bad->data[3] ^= 1;
  volumes().arrived(msg::CtVolume::ConstPtr(bad), kNow);
  EXPECT_EQ(ct_refusal().code(), Status::INVALID_MESSAGE);
  EXPECT_FALSE(volumes().newest_ct());
}

/// It could not be registered, and is there once it can be.
TEST_F(HeldCtTest, UltrasoundIsReadyOnceTheCtIsThere) {
  volumes().arrived(msg::PreScanVolume::ConstPtr(ultrasound_message(1)), kNow);
  EXPECT_EQ(newest_s(), 1.0);
  EXPECT_EQ(volumes().ready_ultrasound().number, 0U);
  arrive(1);
  EXPECT_EQ(held_revision(), 1U);
  EXPECT_EQ(volumes().ready_ultrasound().number, 1U);
  announce_ct(2);
  EXPECT_EQ(volumes().ready_ultrasound().number, 0U);
  arrive(2);
  EXPECT_EQ(held_revision(), 2U);
  EXPECT_EQ(volumes().ready_ultrasound().number, 1U);
}

TEST_F(HeldCtTest, MalformedCtHidesOlderOne) {
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

TEST_F(HeldCtTest, CtIsNewestUntilAnotherArrives) {
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

}  // namespace
}  // namespace usct::ros_interface
