#pragma once

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <numeric>
#include <vector>

#include "us_ct_registration/progress.h"

namespace usct {

/// The first exception of tasks that run in parallel. It is kept, and tasks that have not begun are
/// skipped.
class FirstFailure {
 public:
  template <typename Body>
  void guard(const Body& body) {
    if (failed_.load(std::memory_order_relaxed)) return;
    try {
      body();
    } catch (...) {
      // A mutex, since an exception that leaves a critical section of OpenMP would terminate the
      // program.
      const std::lock_guard<std::mutex> lock(failing_);
      if (!failed_.exchange(true)) failure_ = std::current_exception();
    }
  }
  bool failed() const { return failed_; }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::exception_ptr failure_;
  std::atomic<bool> failed_{false};
  std::mutex failing_;
};

/// Runs `body(i)` for i in [0, count) on the threads of OpenMP. The order is not fixed, so each
/// body must write to memory of its own; the result then does not depend on the number of threads.
/// The first exception of a body (or of `progress`) ends the loop early and is thrown here.
template <typename Body>
void parallel_for(int count, const Body& body, const Progress& progress = {}) {
  FirstFailure failure;
  std::atomic<int> done{0};
  double reported = 0.0;
  std::mutex reporting;
  const auto report = [&](int finished) {
    const std::lock_guard<std::mutex> lock(reporting);
    // Another thread may have reported a later state already, and progress must never decrease.
    const double fraction = static_cast<double>(finished) / count;
    if (failure.failed() || fraction <= reported) return;
    reported = fraction;
    progress(fraction);
  };
#pragma omp parallel for schedule(dynamic, 1)
  for (int i = 0; i < count; ++i)
    failure.guard([&] {
      body(i);
      const int finished = ++done;
      if (progress) report(finished);
    });
  failure.rethrow();
}

/// Like `parallel_for`, for bodies of equal work. Each thread runs a contiguous range, which is the
/// same in each such loop with the same count, so that a thread finds in its cache what it wrote in
/// the loop before.
template <typename Body>
void parallel_for_alike(int count, const Body& body) {
  FirstFailure failure;
#pragma omp parallel for schedule(static)
  for (int i = 0; i < count; ++i) failure.guard([&] { body(i); });
  failure.rethrow();
}

/// Runs `body(begin, end)` for ranges of at most `at_once` indices that make up [0, count),
/// scheduled as in `parallel_for_alike`.
template <typename Body>
void parallel_ranges(std::size_t count, const Body& body,
                     std::size_t at_once = std::size_t{1} << 13) {
  parallel_for_alike(static_cast<int>((count + at_once - 1) / at_once), [&](int part) {
    const std::size_t begin = static_cast<std::size_t>(part) * at_once;
    body(begin, std::min(count, begin + at_once));
  });
}

/// The sum of `part(begin, end)` over ranges that do not depend on the number of threads, so that
/// the result has the same bits with any number of them.
template <typename Part>
double parallel_sum(std::size_t count, const Part& part) {
  constexpr std::size_t kAtOnce = std::size_t{1} << 15;
  std::vector<double> sums((count + kAtOnce - 1) / kAtOnce);
  parallel_ranges(
      count, [&](std::size_t begin, std::size_t end) { sums[begin / kAtOnce] = part(begin, end); },
      kAtOnce);
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

}  // namespace usct
