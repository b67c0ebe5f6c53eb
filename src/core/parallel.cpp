#include "parallel.h"

#include <sched.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

thread_local int threads_of_loops = 0;  // 0: one for each processor
thread_local bool is_in_body = false;

/// A part of a loop's indices. A cache line each, since all threads count in their own.
struct alignas(64) Part {
  std::atomic<int> next{0};
  int end = 0;
};

/// The indices of one loop, and the threads that help with it.
class Loop {
 public:
  Loop(int count, int threads, const std::function<void(int)>& body)
      : body_(body), parts_(static_cast<std::size_t>(threads)) {
    for (int p = 0; p < threads; ++p) {
      Part& part = parts_[static_cast<std::size_t>(p)];
      part.next = static_cast<int>(static_cast<long>(count) * p / threads);
      part.end = static_cast<int>(static_cast<long>(count) * (p + 1) / threads);
    }
  }

  /// Runs the bodies that no thread has begun, first those of the part that is this thread's own.
  void run(std::size_t own) {
    const bool before = std::exchange(is_in_body, true);
    for (std::size_t p = 0; p < parts_.size(); ++p) run_part(parts_[(own + p) % parts_.size()]);
    is_in_body = before;
  }
  bool failed() const { return failed_; }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

  // Of the pool, which guards them by its mutex.
  int places = 0;   // threads that may still come
  int helpers = 0;  // threads that have come and not left
  std::condition_variable left;

 private:
  void run_part(Part& part) {
    try {
      for (int i = part.next++; i < part.end && !failed_; i = part.next++) body_(i);
    } catch (...) {
      if (!failed_.exchange(true)) failure_ = std::current_exception();
    }
  }

  const std::function<void(int)>& body_;
  std::vector<Part> parts_;
  std::atomic<bool> failed_{false};
  std::exception_ptr failure_;  // of the thread that set `failed_`; read when all have left
};

/// Threads that sleep until there is a loop to help with.
class Pool {
 public:
  /// Runs a loop on the calling thread and on up to `helpers` of the pool.
  void run(Loop& loop, int helpers) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      while (!stopped_ && threads_.size() < static_cast<std::size_t>(helpers))
        threads_.emplace_back([this, own = threads_.size() + 1] { help(own); });
      loop.places = helpers;
      open_.push_back(&loop);
    }
    for (int i = 0; i < helpers; ++i) opened_.notify_one();
    loop.run(0);
    std::unique_lock<std::mutex> lock(mutex_);
    open_.erase(std::remove(open_.begin(), open_.end(), &loop), open_.end());
    loop.left.wait(lock, [&] { return loop.helpers == 0; });
  }

  /// From now on loops run on their callers alone.
  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopped_ = true;
    }
    opened_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

 private:
  void help(std::size_t own) {
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
      opened_.wait(lock, [&] { return stopped_ || !open_.empty(); });
      if (stopped_) return;
      Loop& loop = *open_.front();
      if (--loop.places == 0) open_.pop_front();
      ++loop.helpers;
      lock.unlock();
      loop.run(own);
      lock.lock();
      if (--loop.helpers == 0) loop.left.notify_one();
    }
  }

  std::mutex mutex_;
  std::condition_variable opened_;
  std::deque<Loop*> open_;  // loops with places
  bool stopped_ = false;
  std::vector<std::thread> threads_;
};

/// The threads end with the program, or when the library is unloaded; the pool itself stays for
/// threads that still have loops then.
Pool& pool() {
  static Pool* const pool = new Pool;
  static const struct Stop {
    ~Stop() { pool->stop(); }
  } stop;
  return *pool;
}

void run_loop(int count, const std::function<void(int)>& body) {
  const int threads = is_in_body ? 1 : std::min(count, thread_count());
  if (threads < 1) return;
  Loop loop(count, threads, body);
  if (threads == 1)
    loop.run(0);
  else
    pool().run(loop, threads - 1);
  loop.rethrow();
}

}  // namespace

int processor_count() {
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof(allowed), &allowed) == 0) return CPU_COUNT(&allowed);
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

int thread_count() {
  static const int processors = processor_count();
  return threads_of_loops > 0 ? threads_of_loops : processors;
}

ThreadCount::ThreadCount(int threads) : before_(threads_of_loops) {
  if (threads < 1) throw InputError("threads", "is " + std::to_string(threads) + ", must be >= 1");
  threads_of_loops = threads;
}

ThreadCount::~ThreadCount() { threads_of_loops = before_; }

void parallel_for(int count, const std::function<void(int)>& body, const Progress& progress) {
  if (!progress) return run_loop(count, body);
  std::atomic<int> done{0};
  double reported = 0.0;
  std::mutex reporting;
  run_loop(count, [&](int i) {
    body(i);
    const double fraction = static_cast<double>(++done) / count;
    const std::lock_guard<std::mutex> lock(reporting);
    // Another thread may have reported a later state already, and progress must never decrease.
    if (fraction <= reported) return;
    reported = fraction;
    progress(fraction);
  });
}

}  // namespace usct
