#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <numeric>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/threads.h"

namespace usct {

/// Runs `body(i)` for i in [0, count) on at most `thread_count()` threads, the calling one among
/// them. The order is not fixed, so each body must write to memory of its own; the result then does
/// not depend on the number of threads. The threads of a loop also share the loops within its
/// bodies, so that none waits while another one has a long body to run.
///
/// The threads are those of oneTBB. They sleep while they wait, and the caller waits only for
/// bodies that have begun: on a busy machine it does the work of threads that do not get a
/// processor.
///
/// The first exception of a body (or of `progress`) ends the loop early and is thrown here.
void parallel_for(int count, const std::function<void(int)>& body, const Progress& progress = {});

/// Runs `body(begin, end)` for ranges of at most `at_once` indices that make up [0, count), as
/// `parallel_for` does.
template <typename Body>
void parallel_ranges(std::size_t count, const Body& body,
                     std::size_t at_once = std::size_t{1} << 13) {
  parallel_for(static_cast<int>((count + at_once - 1) / at_once), [&](int part) {
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
