#include "ros/registration/registration_worker.h"

#include "ros/node/guarded_queue.h"
#include "us_ct_registration/threads.h"

namespace usct::ros_interface {

RegistrationWorker::RegistrationWorker(RegistrationQueue& queue, Work work)
    : queue_(queue), work_(std::move(work)), thread_([this] { loop(); }) {}

RegistrationWorker::~RegistrationWorker() {
  queue_.stop();
  thread_.join();
}

RegistrationQueue::Job RegistrationWorker::continuous_job() {
  if (!work_.newest) return nullptr;
  if (work_.is_decision_awaited && work_.is_decision_awaited()) return nullptr;
  const HeldVolumes::Ready ready = work_.newest();
  if (ready.number <= continued_) return nullptr;
  const bool is_first = continued_ == 0;
  continued_ = ready.number;
  if (is_first && work_.was_registered && work_.was_registered(ready.stamp)) return nullptr;
  auto job = std::make_shared<RegistrationJob>("continuous");
  job->request.us_stamp = ready.stamp;
  job->request.may_track = true;
  return job;
}

RegistrationQueue::Job RegistrationWorker::background_job() {
  if (!work_.is_ct_unprepared || !work_.is_ct_unprepared()) return continuous_job();
  auto job = std::make_shared<RegistrationJob>("preparation of the CT");
  job->prepares_ct = true;
  return job;
}

void RegistrationWorker::loop() {
  const ThreadCount of_loops(work_.threads > 0 ? work_.threads : processor_count());
  while (const RegistrationQueue::Job job = queue_.next([this] { return background_job(); })) {
    if (job->prepares_ct) {
      work_.prepare_ct(*job);
      queue_.finished(*job);
      continue;
    }
    const us_ct_registration::RegistrationResult result = work_.run(*job);
    // The place is freed before the answer is sent, because the caller may ask again at once.
    queue_.finished(*job);
    try {
      if (job->done) job->done(result);
    } catch (const std::exception& error) {
      log_escaped("the answer to a request", error);
    }
  }
}

}  // namespace usct::ros_interface
