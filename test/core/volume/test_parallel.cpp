#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>

#include "parallel.h"

namespace usct::test {
namespace {

constexpr int kCount = 1000;

TEST(ParallelFor, WhatTheBodyThrowsReachesTheCaller) {
  EXPECT_THROW(parallel_for(kCount,
                            [](int i) {
                              if (i == 7) throw std::runtime_error("body");
                            }),
               std::runtime_error);
}

TEST(ParallelFor, ProgressCancelsByThrowing) {
  std::atomic<int> bodies{0};
  double last = 0.0;
  EXPECT_THROW(parallel_for(
                   kCount, [&](int) { ++bodies; },
                   [&](double fraction) {
                     last = fraction;
                     if (fraction > 0.3) throw std::runtime_error("cancelled");
                   }),
               std::runtime_error);
  EXPECT_LT(bodies, kCount);
  EXPECT_GT(last, 0.3);
}

TEST(ParallelFor, ProgressRisesToOne) {
  double last = 0.0;
  parallel_for(
      kCount, [](int) {},
      [&](double fraction) {
        EXPECT_GT(fraction, last);
        last = fraction;
      });
  EXPECT_EQ(last, 1.0);
}

}  // namespace
}  // namespace usct::test
