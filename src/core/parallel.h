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

/// Keeps the first exception of bodies that run in parallel, after which further bodies do not run.
class FirstFailure {
 public:
  template <typename Body>
  void guard(const Body& body) {
    if (failed_.load(std::memory_order_relaxed)) return;
    try {
      body();
    } catch (...) {
      // Not a critical section of OpenMP: an exception that leaves one ends the program.
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

/// Runs `body(i)` for i in [0, count), on the threads of OpenMP. The order is not fixed: if each
/// body writes only to places of its own, the result does not depend on the number of threads. The
/// first exception of a body (or of `progress`) ends the loop early and is thrown here.
template <typename Body>
void parallel_for(int count, const Body& body, const Progress& progress = {}) {
  FirstFailure failure;
  std::atomic<int> done{0};
  double reported = 0.0;
  std::mutex reporting;
  const auto report = [&](int finished) {
    const std::lock_guard<std::mutex> lock(reporting);
    // Another thread may have reported a later state meanwhile: progress never runs back.
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

/// Likewise, for bodies of equal work: each thread runs neighbours, and in the next such loop the
/// same ones again, so that it finds what it wrote in its own cache.
template <typename Body>
void parallel_for_alike(int count, const Body& body) {
  FirstFailure failure;
#pragma omp parallel for schedule(static)
  for (int i = 0; i < count; ++i) failure.guard([&] { body(i); });
  failure.rethrow();
}

/// Runs `body(begin, end)` for ranges of at most `at_once` that make up [0, count), likewise.
template <typename Body>
void parallel_ranges(std::size_t count, const Body& body,
                     std::size_t at_once = std::size_t{1} << 13) {
  parallel_for_alike(static_cast<int>((count + at_once - 1) / at_once), [&](int part) {
    const std::size_t begin = static_cast<std::size_t>(part) * at_once;
    body(begin, std::min(count, begin + at_once));
  });
}

/// The sum of `part(begin, end)` over ranges that are always the same ones: it has the same bits
/// with any number of threads.
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
