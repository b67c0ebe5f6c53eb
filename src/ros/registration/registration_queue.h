#pragma once

#include <us_ct_registration/RegistrationResult.h>

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "ros/registration/registrar.h"

namespace usct::ros_interface {

/// A registration to be run, or the preparation of a CT for registrations.
struct RegistrationJob {
  explicit RegistrationJob(const std::string& asked_by);
  RegistrationJob(const RegistrationJob&) = delete;
  RegistrationJob& operator=(const RegistrationJob&) = delete;

  /// Name of the request, for messages.
  std::string name;
  /// Its `cancelled` reads the flag below.
  RegistrationRequest request;
  std::atomic<bool> cancelled{false};
  /// Whether the CT is prepared, and nothing registered.
  bool prepares_ct = false;
  /// Receives the result. Empty for preparations and continuous registrations, for which no caller
  /// waits.
  std::function<void(const us_ct_registration::RegistrationResult&)> done;
  std::string goal_id;

  /// Such a job gives way to requests.
  bool is_background() const { return !done; }
};

/// Hands registrations from the callbacks that ask for them to the thread that runs them. There is
/// one place: a request reserves it, then fills it, and keeps it until the request is answered.
/// May be called from any thread.
class RegistrationQueue {
 public:
  using Job = std::shared_ptr<RegistrationJob>;

  /// Reserves the place for the request `name` and cancels the background job that runs, if any. If
  /// the place is taken, or after `stop`, returns the reason in words.
  std::optional<std::string> reserve(const std::string& name);
  /// Fills the place that the caller has reserved. Each caller that reserves must call this,
  /// because the worker does not end before.
  void put(const Job& job);
  /// Cancels the request with this goal, if it waits or runs.
  void cancel(const std::string& goal_id);
  /// Cancels the request that waits or runs, if any, and returns its name.
  std::optional<std::string> cancel_request();

  /// Cancels the running registration. From then on `reserve` refuses; a request that has the place
  /// is still handed out, cancelled, so that it is answered.
  void stop();
  /// Never waits for another thread, so that it may be called with any mutex locked.
  bool is_stopping() const;
  /// Makes `next` ask for a background job again.
  void wake();

  /// Waits for the next job, which runs from then on: the request that fills the place or, while
  /// the place is free, the job that `background` returns (null: none). Returns null once the queue
  /// is stopped and all requests are answered.
  Job next(const std::function<Job()>& background);
  /// Must be called when the job has ended; frees its place.
  void finished(const RegistrationJob& job);
  /// Name of the running job; empty: none.
  std::string running() const;

 private:
  mutable std::mutex mutex_;  // guards the members below
  std::condition_variable wake_;
  /// Set under the mutex, so that `next` does not miss it, but read without it: who waits for a
  /// volume asks `is_stopping` with the mutex of HeldVolumes locked, while `next` asks HeldVolumes
  /// for a background job with the mutex of this class locked.
  std::atomic<bool> stopping_{false};
  std::string reserved_;  // name of the request that has the place; empty: none
  Job pending_;           // fills the place, is not yet handed out
  Job running_;
};

}  // namespace usct::ros_interface
