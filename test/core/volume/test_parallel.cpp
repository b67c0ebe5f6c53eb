#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <future>
#include <mutex>
#include <numeric>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/io/expect_input_error.h"
#include "parallel.h"
#include "with_threads.h"

namespace usct::test {
namespace {

constexpr int kCount = 1000;

/// How often each index ran.
std::vector<int> runs_of(int count) {
  std::vector<int> runs(static_cast<std::size_t>(count));
  parallel_for(count, [&](int i) { ++runs[static_cast<std::size_t>(i)]; });
  return runs;
}

TEST(ParallelFor, RunsEachOnceWithAnyNumberOfThreads) {
  for (const int threads : {1, 2, 3, 8})
    for (const int count : {0, 1, 2, 3, 7, kCount})
      EXPECT_EQ(with_threads(threads, [&] { return runs_of(count); }),
                std::vector<int>(static_cast<std::size_t>(count), 1));
}

TEST(ParallelFor, HasNoMoreThreadsThanAsked) {
  for (const int threads : {1, 2, 3, 8}) {
    const ThreadCount scope(threads);
    std::mutex mutex;
    std::set<std::thread::id> seen;
    parallel_for(kCount, [&](int) {
      const std::lock_guard<std::mutex> lock(mutex);
      seen.insert(std::this_thread::get_id());
    });
    EXPECT_LE(seen.size(), static_cast<std::size_t>(threads));
  }
}

TEST(ParallelFor, WhatTheBodyThrowsReachesTheCaller) {
  for (const int threads : {1, 2, 3})
    for (const int bad : {0, 7, kCount - 1}) {
      const ThreadCount scope(threads);
      EXPECT_THROW(parallel_for(kCount,
                                [&](int i) {
                                  if (i == bad) throw std::runtime_error("body");
                                }),
                   std::runtime_error);
      EXPECT_EQ(runs_of(kCount), std::vector<int>(kCount, 1));  // the threads are still there
    }
}

TEST(ParallelFor, ThreadsShareALoopWithinABody) {
  if (processor_count() == 1) return;  // no other thread can come
  // A busy machine may let the other thread wait for a processor: the bodies wait for it.
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  std::mutex mutex;
  std::condition_variable another_came;
  std::set<std::thread::id> seen;
  parallel_for(2, [&](int outer) {
    if (outer == 1) return;  // the thread of this body has nothing else to do
    parallel_for(kCount, [&](int) {
      std::unique_lock<std::mutex> lock(mutex);
      seen.insert(std::this_thread::get_id());
      another_came.notify_all();
      another_came.wait_until(lock, deadline, [&] { return seen.size() > 1; });
    });
  });
  EXPECT_GT(seen.size(), 1U);
}

TEST(ParallelFor, LoopsWithinBodiesRunEachOnce) {
  for (const int threads : {1, 2, 3}) {
    const ThreadCount scope(threads);
    std::vector<std::vector<int>> runs(30);
    parallel_for(static_cast<int>(runs.size()),
                 [&](int i) { runs[static_cast<std::size_t>(i)] = runs_of(kCount); });
    for (const std::vector<int>& of_one : runs) EXPECT_EQ(of_one, std::vector<int>(kCount, 1));
  }
}

thread_local int bodies_under_way = 0;

/// A thread may hold a lock while it waits for a loop within its body.
TEST(ParallelFor, AThreadThatWaitsWithinABodyBeginsNoOther) {
  std::atomic<int> begun_within{0};
  parallel_for(100, [&](int) {
    if (bodies_under_way++ != 0) ++begun_within;
    parallel_for(8, [](int) { std::this_thread::sleep_for(std::chrono::microseconds(100)); });
    --bodies_under_way;
  });
  EXPECT_EQ(begun_within, 0);
}

TEST(ParallelFor, LoopsOfSeveralCallersRunBesideEachOther) {
  std::vector<std::future<int>> sums;
  for (int caller = 0; caller < 4; ++caller)
    sums.push_back(std::async(std::launch::async, [caller] {
      const ThreadCount scope(1 + caller);
      int sum = 0;
      for (int repetition = 0; repetition < 200; ++repetition) {
        const std::vector<int> runs = runs_of(50);
        sum += std::accumulate(runs.begin(), runs.end(), 0);
      }
      return sum;
    }));
  for (std::future<int>& sum : sums) EXPECT_EQ(sum.get(), 200 * 50);
}

TEST(ParallelFor, WaitsForNoThreadThatHasNotBegun) {
  // Another loop keeps its threads, as if they did not get a processor.
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  std::promise<void> first_begun;
  std::atomic<int> begun{0};
  const std::future<void> other = std::async(std::launch::async, [&] {
    parallel_for(100, [&](int) {
      if (++begun == 1) first_begun.set_value();
      released.wait();
    });
  });
  first_begun.get_future().wait();
  const ThreadCount scope(3);
  EXPECT_EQ(runs_of(kCount), std::vector<int>(kCount, 1));
  release.set_value();
}

TEST(ThreadCount, HoldsForItsScopeAndItsThread) {
  const int usual = thread_count();
  EXPECT_EQ(usual, processor_count());
  {
    const ThreadCount outer(5);
    EXPECT_EQ(with_threads(2, thread_count), 2);
    EXPECT_EQ(thread_count(), 5);
    EXPECT_EQ(std::async(std::launch::async, thread_count).get(), usual);
  }
  EXPECT_EQ(thread_count(), usual);
  for (const int threads : {0, -3})
    expect_input_error([&] { const ThreadCount wrong(threads); },
                       {"threads", std::to_string(threads), "must be >= 1"});
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
  const auto sum = [] {
    return parallel_sum(kMany, [](std::size_t begin, std::size_t end) {
      double part = 0.0;
      for (std::size_t i = begin; i < end; ++i) part += std::sin(static_cast<double>(i));
      return part;
    });
  };
  const double one = with_threads(1, sum);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(with_threads(threads, sum), one);
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
