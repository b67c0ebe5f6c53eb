#pragma once

#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <cstdint>

#include "us_ct_registration/threads.h"

namespace usct {

/// Reports `items` per iteration (by default voxels of the result), the peak memory of the process
/// so far, and the number of threads.
inline void finish(benchmark::State& state, std::int64_t items) {
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations()) * items);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  state.counters["peak_MiB"] = static_cast<double>(usage.ru_maxrss) / 1024.0;
  state.counters["threads"] = thread_count();
}

}  // namespace usct
