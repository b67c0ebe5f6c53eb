#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/registration/newest_ct.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

constexpr std::uint32_t kFirst = 111;
constexpr std::uint32_t kSecond = 222;
constexpr std::uint32_t kThird = 333;

/// CTs with these checksums.
class NewestCtTest : public testing::Test {
 protected:
  void announce(std::uint32_t crc32, std::uint32_t revision = 1, const std::string& frame = "ct") {
    msg::CtInfo info;
    info.header.frame_id = frame;
    info.crc32 = crc32;
    info.revision = revision;
    newest_.announced(info, now_);
  }
  void arrive(std::uint32_t crc32, std::uint32_t revision = 1) {
    msg::CtVolume volume;
    volume.header.frame_id = "ct";
    volume.crc32 = crc32;
    volume.revision = revision;
    newest_.arrived(volume, now_);
  }
  static HeldCt held(std::uint32_t crc32, std::uint32_t revision = 1) {
    HeldCt ct;
    ct.header.frame_id = "ct";
    ct.crc32 = crc32;
    ct.revision = revision;
    return ct;
  }

  NewestCt::Clock::time_point now_{std::chrono::hours(1)};
  NewestCt newest_{std::chrono::seconds(30)};
};

TEST_F(NewestCtTest, AnAnnouncedCtIsAwaitedUntilItArrives) {
  EXPECT_FALSE(newest_.identity());
  announce(kFirst);
  EXPECT_TRUE(newest_.is_awaited());
  EXPECT_EQ(newest_.identity(), CtIdentity("ct", kFirst));
  EXPECT_FALSE(newest_.refusal(now_ + std::chrono::seconds(29)));
  arrive(kFirst);
  EXPECT_FALSE(newest_.is_awaited());
  EXPECT_TRUE(newest_.is(held(kFirst)));
  announce(kSecond);
  EXPECT_TRUE(newest_.is_awaited());
  EXPECT_FALSE(newest_.is(held(kFirst)));
  arrive(kSecond);
  EXPECT_FALSE(newest_.is_awaited());
  EXPECT_TRUE(newest_.is(held(kSecond)));
}

TEST_F(NewestCtTest, AVolumeMayBeQuickerThanItsAnnouncement) {
  arrive(kFirst);
  announce(kFirst);
  EXPECT_FALSE(newest_.is_awaited());
}

/// As in bags, and of senders that announce nothing.
TEST_F(NewestCtTest, AVolumeNeedNotBeAnnounced) {
  arrive(kFirst);
  EXPECT_TRUE(newest_.is(held(kFirst)));
  announce(kFirst);
  arrive(kSecond);
  EXPECT_FALSE(newest_.is_awaited());
  EXPECT_TRUE(newest_.is(held(kSecond)));
}

/// A ct_server that was started again sends its CT again, with another revision.
TEST_F(NewestCtTest, TheSameCtIsNotAwaitedAgain) {
  arrive(kFirst);
  announce(kFirst, 2);
  EXPECT_FALSE(newest_.is_awaited());
  announce(kFirst, 3, "ct_of_last_month");
  EXPECT_TRUE(newest_.is_awaited()) << "in another frame it is another CT";
}

TEST_F(NewestCtTest, OnlyTheLastOfSeveralIsAwaited) {
  announce(kFirst);
  announce(kSecond);
  arrive(kFirst);
  EXPECT_TRUE(newest_.is_awaited());
  arrive(kSecond);
  EXPECT_FALSE(newest_.is_awaited());
  announce(kThird);
  announce(kSecond);
  EXPECT_FALSE(newest_.is_awaited()) << "it was loaded again before another one had arrived";
}

TEST_F(NewestCtTest, ACtThatIsLostIsTheReasonUntilAnotherArrives) {
  arrive(kFirst);
  announce(kSecond, 7);
  now_ += std::chrono::seconds(30);
  const std::optional<Refusal> lost = newest_.refusal(now_);
  ASSERT_TRUE(lost);
  EXPECT_EQ(lost->code(), msg::StatusCode::NO_CT);
  EXPECT_THAT(lost->what(), testing::HasSubstr("CT revision 7 was announced"));
  arrive(kThird);
  EXPECT_FALSE(newest_.refusal(now_));
  EXPECT_TRUE(newest_.is(held(kThird)));
}

}  // namespace
}  // namespace usct::ros_interface
