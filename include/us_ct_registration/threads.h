#pragma once

namespace usct {

/// The number of processors that this process may use.
int processor_count();

/// The number of threads that loops of the calling thread share: that of the innermost ThreadCount
/// of this thread, `processor_count()` without one. No result depends on it.
int thread_count();

/// Sets `thread_count()` of the thread that makes it, for as long as it lives.
class ThreadCount {
 public:
  /// `threads` may exceed the number of processors. Throws InputError if it is < 1.
  explicit ThreadCount(int threads);
  ~ThreadCount();
  ThreadCount(const ThreadCount&) = delete;
  ThreadCount& operator=(const ThreadCount&) = delete;

 private:
  int before_;
};

}  // namespace usct
