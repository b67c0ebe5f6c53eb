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

  /// Work that follows takes the progress from one fraction of the registration to another.
  void begin_part(double first, double last) {
    first_ = first;
    last_ = last;
  }
  /// Reports the fraction of the present part, unless the progress is further already.
  void report(double fraction) {
    const double now = first_ + fraction * (last_ - first_);
    if (hooks_.progress && now > reported_) hooks_.progress(now);
    reported_ = std::max(reported_, now);
    check_cancelled();
  }

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
  double first_ = 0.0;
  double last_ = 1.0;
  double reported_ = -1.0;
  mutable std::mutex asking_;
  std::atomic<int> evaluations_{0};
  std::map<std::string, double> seconds_;
  Timer* innermost_ = nullptr;
};

}  // namespace usct::registration
