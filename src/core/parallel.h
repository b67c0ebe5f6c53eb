#pragma once

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <map>
#include <mutex>

#include "us_ct_registration/progress.h"

namespace usct {

/// Runs `body(i)` for i in [0, count), on the threads of OpenMP. The order is not fixed, so bodies
/// must write to places of their own; then the result does not depend on the number of threads.
/// The first exception of a body (or of `progress`) ends the loop early and is thrown here.
template <typename Body>
void parallel_for(int count, const Body& body, const Progress& progress = {}) {
  std::exception_ptr failure;
  std::atomic<bool> failed{false};
  std::atomic<int> done{0};
  double reported = 0.0;
  // Not critical sections of OpenMP: an exception that leaves one ends the program.
  std::mutex reporting;
  std::mutex failing;
#pragma omp parallel for schedule(dynamic, 1)
  for (int i = 0; i < count; ++i) {
    if (failed.load(std::memory_order_relaxed)) continue;
    try {
      body(i);
      const int finished = ++done;
      if (progress) {
        const std::lock_guard<std::mutex> lock(reporting);
        // Another thread may have reported a later state meanwhile: progress never runs back.
        const double fraction = static_cast<double>(finished) / count;
        if (!failed && fraction > reported) {
          reported = fraction;
          progress(fraction);
        }
      }
    } catch (...) {
      const std::lock_guard<std::mutex> lock(failing);
      if (!failed.exchange(true)) failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
}

/// Runs `body(begin, end)` for ranges that make up [0, count), likewise; always the same ones, so
/// that sums over ranges have the same bits with any number of threads.
template <typename Body>
void parallel_ranges(std::size_t count, const Body& body) {
  constexpr std::size_t kAtOnce = std::size_t{1} << 15;
  parallel_for(static_cast<int>((count + kAtOnce - 1) / kAtOnce), [&](int part) {
    const std::size_t begin = static_cast<std::size_t>(part) * kAtOnce;
    body(begin, std::min(count, begin + kAtOnce));
  });
}

/// The sum of `part(begin, end)` over the same ranges.
template <typename Part>
double parallel_sum(std::size_t count, const Part& part) {
  std::mutex adding;
  std::map<std::size_t, double> sums;
  parallel_ranges(count, [&](std::size_t begin, std::size_t end) {
    const double sum = part(begin, end);
    const std::lock_guard<std::mutex> lock(adding);
    sums[begin] = sum;
  });
  double total = 0.0;
  for (const auto& [begin, sum] : sums) total += sum;  // in their order
  return total;
}

}  // namespace usct
