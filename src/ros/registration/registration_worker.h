#pragma once

#include <us_ct_registration/RegistrationResult.h>

#include <cstdint>
#include <functional>
#include <thread>

#include "ros/registration/held_volumes.h"
#include "ros/registration/registration_queue.h"

namespace usct::ros_interface {

/// The thread that registers: it takes registrations from a queue and runs them one at a time.
/// While no request waits, it prepares a new CT, so that the first request does not wait for that.
class RegistrationWorker {
 public:
  struct Work {
    /// Number of threads of one registration; 0: one for each processor.
    int threads = 0;
    /// Returns the newest ultrasound. Each is registered once while no request waits; if the
    /// function is empty, only requests are registered.
    std::function<HeldVolumes::Ready()> newest;
    /// Whether an earlier process has registered the ultrasound with this stamp, which is asked of
    /// the first one only: a latched topic sends it again after a restart, when tf has forgotten
    /// its time. May be empty.
    std::function<bool(const ::ros::Time& us_stamp)> was_registered;
    /// Whether a person has to decide about a result: no continuous registration begins meanwhile.
    /// May be empty. Called as `newest` is, and after the queue was woken.
    std::function<bool()> is_decision_awaited;
    /// Whether a CT waits to be prepared, and what prepares it; the latter may end early if the job
    /// is cancelled. Both may be empty, and must not throw.
    std::function<bool()> is_ct_unprepared;
    std::function<void(RegistrationJob&)> prepare_ct;
    /// Runs one registration. Must not throw.
    std::function<us_ct_registration::RegistrationResult(RegistrationJob&)> run;
  };

  /// Starts the thread. The queue, and what `work` uses, must outlive the worker.
  RegistrationWorker(RegistrationQueue& queue, Work work);
  /// Stops the queue, cancels the running registration, answers the waiting request, and joins the
  /// thread.
  ~RegistrationWorker();
  RegistrationWorker(const RegistrationWorker&) = delete;
  RegistrationWorker& operator=(const RegistrationWorker&) = delete;

 private:
  void loop();
  RegistrationQueue::Job background_job();
  RegistrationQueue::Job continuous_job();

  RegistrationQueue& queue_;
  const Work work_;
  /// Number of the last ultrasound that was registered continuously, or before; 0: none.
  std::uint64_t continued_ = 0;
  std::thread thread_;  // last: it uses the members above
};

}  // namespace usct::ros_interface
