#pragma once

#include "us_ct_registration/threads.h"

namespace usct::test {

/// What `work` returns where loops are shared by so many threads.
template <typename Work>
auto with_threads(int threads, const Work& work) {
  const ThreadCount scope(threads);
  return work();
}

}  // namespace usct::test
