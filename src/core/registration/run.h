#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <string>

#include "us_ct_registration/registration/registration.h"

namespace usct::registration {

/// Thrown through loops and optimizers when the caller wants to stop.
struct Cancelled {};

/// The services of one registration that all its steps share: cancellation, progress, and the count
/// of evaluations and wall time.
class Run {
 public:
  explicit Run(const RegistrationHooks& hooks) : hooks_(hooks) {}
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  /// Throws Cancelled if the caller wants to stop. May be called from any thread.
  void check_cancelled() const {
    if (!hooks_.cancelled) return;
    const std::lock_guard<std::mutex> one_at_a_time(asking_);
    if (hooks_.cancelled()) throw Cancelled{};
  }
  Check check() const {
    return [this] { check_cancelled(); };
  }

  /// While it lives, work takes the progress from one fraction of the part around it to another,
  /// and reports fractions of its own.
  class Part {
   public:
    Part(Run& run, double first, double last)
        : run_(run), first_(run.first_), length_(run.length_) {
      run.first_ += first * length_;
      run.length_ *= last - first;
    }
    ~Part() {
      run_.first_ = first_;
      run_.length_ = length_;
    }
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;

   private:
    Run& run_;
    const double first_, length_;
  };
  /// Reports a fraction of the present part, unless the progress is further already.
  void report(double fraction) {
    report_whole(first_ + fraction * length_);
    check_cancelled();
  }
  /// Reports the end of the registration, which nobody can cancel any more.
  void report_end() { report_whole(1.0); }

  void count_evaluations(std::size_t count) { evaluations_ += static_cast<int>(count); }
  int evaluations() const { return evaluations_; }

  /// Runs `work`, and adds its wall time to that of the step. A step within another one is not
  /// counted there too, so that all steps together take no longer than the registration. Steps are
  /// those of one thread.
  template <typename Work>
  auto timed(const char* step, const Work& work) {
    const Timer timer(seconds_[step], innermost_);
    return work();
  }
  const std::map<std::string, double>& seconds() const { return seconds_; }

 private:
  void report_whole(double fraction) {
    if (hooks_.progress && fraction > reported_) hooks_.progress(fraction);
    reported_ = std::max(reported_, fraction);
  }

  class Timer {
   public:
    Timer(double& seconds, Timer*& innermost)
        : seconds_(seconds), innermost_(innermost), outer_(innermost) {
      innermost_ = this;
    }
    ~Timer() {
      const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin_;
      seconds_ += taken.count() - of_inner_;
      if (outer_ != nullptr) outer_->of_inner_ += taken.count();
      innermost_ = outer_;
    }
    Timer(const Timer&) = delete;
    Timer& operator=(const Timer&) = delete;

   private:
    double& seconds_;
    Timer*& innermost_;
    Timer* outer_;
    double of_inner_ = 0.0;
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  };

  const RegistrationHooks& hooks_;
  double first_ = 0.0;  // of the present part, as fractions of the registration
  double length_ = 1.0;
  double reported_ = -1.0;
  mutable std::mutex asking_;
  std::atomic<int> evaluations_{0};
  std::map<std::string, double> seconds_;
  Timer* innermost_ = nullptr;
};

}  // namespace usct::registration
