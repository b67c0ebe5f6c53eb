#include <gtest/gtest.h>
#include <ros/callback_queue.h>

#include <atomic>
#include <boost/make_shared.hpp>
#include <chrono>
#include <functional>
#include <future>
#include <stdexcept>
#include <thread>

#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

class Callback : public ::ros::CallbackInterface {
 public:
  explicit Callback(std::function<void()> work) : work_(std::move(work)) {}
  CallResult call() override {
    work_();
    return Success;
  }

 private:
  const std::function<void()> work_;
};

TEST(GuardedQueue, AnExceptionEndsItsCallbackOnly) {
  ::ros::CallbackQueue queue;
  GuardedQueue guarded(queue);
  int called = 0;
  guarded.addCallback(boost::make_shared<Callback>([] { throw std::runtime_error("far"); }), 1);
  guarded.addCallback(boost::make_shared<Callback>([&] { ++called; }), 1);
  EXPECT_NO_THROW(queue.callAvailable());
  EXPECT_EQ(called, 1);
}

TEST(GuardedQueue, RemovesCallbacksByTheirOwner) {
  ::ros::CallbackQueue queue;
  GuardedQueue guarded(queue);
  int called = 0;
  guarded.addCallback(boost::make_shared<Callback>([&] { called += 1; }), 1);
  guarded.addCallback(boost::make_shared<Callback>([&] { called += 10; }), 2);
  guarded.removeByID(1);
  queue.callAvailable();
  EXPECT_EQ(called, 10);
}

TEST(GuardedQueue, WaitsForWhatItHolds) {
  ::ros::CallbackQueue queue;
  std::atomic<int> called = 0;
  std::atomic<bool> ended = false;
  for (int i = 0; i < 5; ++i)
    queue.addCallback(boost::make_shared<Callback>([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      ++called;
    }));
  auto served = std::async(std::launch::async, [&] {
    while (!ended) queue.callAvailable(::ros::WallDuration(0.01));
  });
  wait_for_held(queue);
  EXPECT_EQ(called, 5);
  ended = true;
  served.get();
}

TEST(Times, AnyTwoHaveADifference) {
  const ::ros::Time first(0, 1);
  const ::ros::Time last(4294967295U, 0);
  EXPECT_NEAR(seconds_between(first, last), 4294967295.0, 1e-3);
  EXPECT_NEAR(seconds_between(last, first), -4294967295.0, 1e-3);
  EXPECT_NEAR(seconds_between(::ros::Time(10, 250000000), ::ros::Time(8, 750000000)), -1.5, 1e-9);
}

TEST(Times, AreShiftedWithinTheirRange) {
  EXPECT_EQ(shifted(::ros::Time(8, 750000000), 1.5), ::ros::Time(10, 250000000));
  EXPECT_EQ(shifted(::ros::Time(1.0), -2.0), ::ros::Time());
  EXPECT_EQ(shifted(::ros::Time(4294967290U, 0), 60.0), ::ros::TIME_MAX);
}

TEST(Times, FarAheadOfTheClockAreRefused) {
  const ::ros::Time now(1000.0);
  EXPECT_NO_THROW(require_not_ahead(::ros::Time(1029.0), now, "volume", "stamp"));
  EXPECT_NO_THROW(require_not_ahead(::ros::Time(1.0), now, "volume", "stamp"));
  EXPECT_THROW(require_not_ahead(::ros::Time(1031.0), now, "volume", "stamp"), InputError);
  EXPECT_THROW(require_not_ahead(::ros::Time(4294967295U, 0), now, "volume", "stamp"), InputError);
  // Simulated time has not begun: nothing is known.
  EXPECT_NO_THROW(require_not_ahead(::ros::Time(1031.0), ::ros::Time(), "volume", "stamp"));
}

TEST(Times, RanBackByMoreThanThreadsMayDiffer) {
  EXPECT_TRUE(ran_back(::ros::Time(1000.0), ::ros::Time(1000.2)));
  EXPECT_TRUE(ran_back(::ros::Time(1000.0), ::ros::Time(4294967295U, 0)));
  EXPECT_FALSE(ran_back(::ros::Time(1000.0), ::ros::Time(1000.01)));
  EXPECT_FALSE(ran_back(::ros::Time(1000.0), ::ros::Time(999.0)));
}

TEST(GuardedTimer, AnExceptionIsLoggedAndGoesNoFurther) {
  int called = 0;
  const auto callback = guarded([&](const ::ros::WallTimerEvent&) {
    ++called;
    throw std::runtime_error("a test");
  });
  EXPECT_NO_THROW(callback(::ros::WallTimerEvent()));
  EXPECT_EQ(called, 1);
}

TEST(Times, StampsOfHeadersMustBeSetToo) {
  const ::ros::Time now(1000.0);
  EXPECT_NO_THROW(require_stamped(::ros::Time(999.0), now, "volume"));
  EXPECT_THROW(require_stamped(::ros::Time(), now, "volume"), InputError);
  EXPECT_THROW(require_stamped(::ros::Time(), ::ros::Time(), "volume"), InputError);
  EXPECT_THROW(require_stamped(::ros::Time(1031.0), now, "volume"), InputError);
}

TEST(Times, BeforeTheClockBeganHaveNoAge) {
  const ::ros::Time now(1795620968.0);
  EXPECT_EQ(stamp_and_age(valid_stamp(::ros::Time(1795620966.5)), now),
            "1795620966.500 (1.500 s ago)");
  const ::ros::Time before = valid_stamp(::ros::Time());
  EXPECT_FALSE(before.isZero());
  EXPECT_EQ(stamp_and_age(before, now), "before the clock began");
}

}  // namespace
}  // namespace usct::ros_interface
