#include "ros/registration/registration_queue.h"

#include <chrono>

namespace usct::ros_interface {
namespace {

/// Whether a decision is awaited changes with time alone as well, and nothing wakes for that.
constexpr std::chrono::milliseconds kLook(200);

}  // namespace

RegistrationJob::RegistrationJob(const std::string& asked_by) : name(asked_by) {
  request.cancelled = [this] { return cancelled.load(); };
  request.progress = [](double, const std::string&) {};
}

std::optional<std::string> RegistrationQueue::reserve(const std::string& name) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (stopping_) return "the node is shutting down";
  if (!reserved_.empty()) return "one registration at a time; this one runs: " + reserved_;
  reserved_ = name;
  if (running_ && running_->is_background()) running_->cancelled = true;
  return std::nullopt;
}

void RegistrationQueue::put(const Job& job) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    pending_ = job;
  }
  wake_.notify_all();
}

void RegistrationQueue::cancel(const std::string& goal_id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Job& job : {pending_, running_})
    if (job && job->goal_id == goal_id) job->cancelled = true;
}

std::optional<std::string> RegistrationQueue::cancel_request() {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Job& job : {pending_, running_})
    if (job && !job->is_background()) {
      job->cancelled = true;
      return job->name;
    }
  return std::nullopt;
}

void RegistrationQueue::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
    if (running_) running_->cancelled = true;
  }
  wake_.notify_all();
}

bool RegistrationQueue::is_stopping() const { return stopping_; }

void RegistrationQueue::wake() {
  // `next` holds the mutex from its last look until it waits. Taking the mutex here makes sure that
  // it does not miss this call in between.
  { const std::lock_guard<std::mutex> lock(mutex_); }
  wake_.notify_all();
}

RegistrationQueue::Job RegistrationQueue::next(const std::function<Job()>& background) {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_ || !reserved_.empty()) {
    Job job = std::move(pending_);
    pending_.reset();
    if (!job && reserved_.empty()) job = background();
    if (job) {
      running_ = job;
      if (stopping_) job->cancelled = true;
      return job;
    }
    wake_.wait_for(lock, kLook);
  }
  return nullptr;
}

void RegistrationQueue::finished(const RegistrationJob& job) {
  const std::lock_guard<std::mutex> lock(mutex_);
  running_.reset();
  if (!job.is_background()) reserved_.clear();
}

std::string RegistrationQueue::running() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return running_ ? running_->name : "";
}

}  // namespace usct::ros_interface
