#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <stdexcept>
#include <vector>

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

TEST(ParallelForAlike, RunsEachOnceAndThrowsWhatABodyThrows) {
  std::vector<int> runs(kCount);
  parallel_for_alike(kCount, [&](int i) { ++runs[static_cast<std::size_t>(i)]; });
  EXPECT_EQ(runs, std::vector<int>(kCount, 1));
  EXPECT_THROW(parallel_for_alike(kCount,
                                  [](int i) {
                                    if (i == kCount - 1) throw std::runtime_error("body");
                                  }),
               std::runtime_error);
}

TEST(ParallelRanges, CoverEachIndexOnce) {
  for (const std::size_t count : {0, 1, 7, 8, 9, 64}) {
    std::vector<int> runs(count);
    parallel_ranges(
        count,
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) ++runs[i];
        },
        8);
    EXPECT_EQ(runs, std::vector<int>(count, 1));
  }
}

TEST(ParallelSum, HasTheSameBitsWithAnyNumberOfThreads) {
  constexpr std::size_t kMany = 200'000;
  const auto sum_with = [](int threads) {
    omp_set_num_threads(threads);
    return parallel_sum(kMany, [](std::size_t begin, std::size_t end) {
      double sum = 0.0;
      for (std::size_t i = begin; i < end; ++i) sum += std::sin(static_cast<double>(i));
      return sum;
    });
  };
  const int usual = omp_get_max_threads();
  const double one = sum_with(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(sum_with(threads), one);
  omp_set_num_threads(usual);
  // Sum of sin(i), i = 0 to n: sin(n / 2) sin((n + 1) / 2) / sin(1 / 2).
  const double n = kMany - 1;
  EXPECT_NEAR(one, std::sin(n / 2) * std::sin((n + 1) / 2) / std::sin(0.5), 1e-9);
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
