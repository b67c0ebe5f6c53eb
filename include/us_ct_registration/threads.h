#pragma once

namespace usct {

/// The number of processors that this process may use.
int processor_count();

/// The most threads that loops of the calling thread share: that of the innermost ThreadCount
/// of this thread, `processor_count()` without one. No result depends on it.
int thread_count();

/// Sets `thread_count()` of the thread that makes it, for as long as it lives.
class ThreadCount {
 public:
  /// Loops have no more threads than there are processors, even if it asks for more. Throws
  /// InputError if `threads` is < 1.
  explicit ThreadCount(int threads);
  ~ThreadCount();
  ThreadCount(const ThreadCount&) = delete;
  ThreadCount& operator=(const ThreadCount&) = delete;

 private:
  int before_;
};

}  // namespace usct
