#include <gtest/gtest.h>

#include "ros/registration/acquisitions.h"

namespace usct::ros_interface {
namespace {

using us_ct_registration::Acquisition;

Acquisition acquisition(std::uint64_t id, std::uint8_t state, double seconds) {
  Acquisition message;
  message.id = id;
  message.state = state;
  message.header.stamp = ::ros::Time(seconds);
  return message;
}

TEST(Acquisitions, ARecorderThatIsGoneIsNotWaitedForForEver) {
  const Acquisitions::Clock::time_point begin{std::chrono::hours(1)};
  Acquisitions acquisitions;
  acquisitions.announced(acquisition(1, Acquisition::RECORDING, 100.0), begin);
  EXPECT_TRUE(acquisitions.awaited(begin + std::chrono::minutes(14)));
  EXPECT_FALSE(acquisitions.awaited(begin + std::chrono::minutes(16)));
}

/// Stamps of files need not rise, so that a later volume may be older than the lost one.
TEST(Acquisitions, AVolumeThatWasLostDoesNotHideTheNextOne) {
  const Acquisitions::Clock::time_point begin{std::chrono::hours(1)};
  const auto soon = begin + Acquisitions::kPatience / 2;
  const auto late = begin + 2 * Acquisitions::kPatience;
  Acquisitions acquisitions;
  acquisitions.announced(acquisition(1, Acquisition::RECORDED, 100.0), begin);
  acquisitions.arrived(::ros::Time(50.0), soon);
  EXPECT_TRUE(acquisitions.awaited(soon));
  EXPECT_TRUE(acquisitions.refusal(begin, late));
  acquisitions.arrived(::ros::Time(60.0), late);
  EXPECT_FALSE(acquisitions.awaited(late));
  EXPECT_FALSE(acquisitions.refusal(begin, late));
}

/// The ids are times of a clock as well.
TEST(Acquisitions, IdsBeginAnewWhenTimeRunsBack) {
  const Acquisitions::Clock::time_point begin{std::chrono::hours(1)};
  Acquisitions acquisitions;
  acquisitions.announced(acquisition(50, Acquisition::RECORDED, 100.0), begin);
  acquisitions.announced(acquisition(5, Acquisition::RECORDED, 12.0), begin);
  EXPECT_EQ(acquisitions.awaited(begin)->id, 50U);
  acquisitions.forget();
  EXPECT_FALSE(acquisitions.awaited(begin));
  acquisitions.announced(acquisition(5, Acquisition::RECORDED, 12.0), begin);
  ASSERT_TRUE(acquisitions.awaited(begin));
  EXPECT_EQ(acquisitions.awaited(begin)->id, 5U);
}

}  // namespace
}  // namespace usct::ros_interface
