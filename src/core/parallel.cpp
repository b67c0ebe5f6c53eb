#include "parallel.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <mutex>
#include <string>
#include <utility>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

thread_local int threads_of_loops = 0;  // 0: one for each processor
thread_local bool is_in_body = false;

/// While it lives, its thread runs the body of a loop that threads share.
class InBody {
 public:
  InBody() : before_(std::exchange(is_in_body, true)) {}
  ~InBody() { is_in_body = before_; }
  InBody(const InBody&) = delete;
  InBody& operator=(const InBody&) = delete;

 private:
  bool before_;
};

void share(int count, const std::function<void(int)>& body) {
  tbb::parallel_for(
      0, count,
      [&](int i) {
        const InBody scope;
        body(i);
      },
      tbb::simple_partitioner());
}

void run_loop(int count, const std::function<void(int)>& body) {
  const int threads = std::min(thread_count(), processor_count());
  if (count <= 1 || threads <= 1) {
    for (int i = 0; i < count; ++i) body(i);
    return;
  }
  // The threads of the loop around share this one too. While a thread waits here, it must not begin
  // another body of the loop around: it may hold a lock, or be half-way through shared memory.
  if (is_in_body) return tbb::this_task_arena::isolate([&] { share(count, body); });
  // The calling thread's own arena has a place for each processor; fewer need an arena of their
  // own, which takes some time to make.
  if (threads == processor_count())
    share(count, body);
  else
    tbb::task_arena(threads).execute([&] { share(count, body); });
}

}  // namespace

int processor_count() {
  static const int count = tbb::info::default_concurrency();
  return count;
}

int thread_count() { return threads_of_loops > 0 ? threads_of_loops : processor_count(); }

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
