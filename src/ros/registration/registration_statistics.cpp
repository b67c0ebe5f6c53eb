#include "ros/registration/registration_statistics.h"

#include "ros/conversions/times.h"
#include "ros/node/refusal.h"

namespace usct::ros_interface {
namespace {

using Status = us_ct_registration::StatusCode;
using diagnostic_msgs::DiagnosticStatus;
using diagnostic_updater::DiagnosticStatusWrapper;

/// The rate is taken over this time.
constexpr std::chrono::seconds kRateWindow(10);

void describe_held(const HeldState& held, const ::ros::Time& now, DiagnosticStatusWrapper& status) {
  if (held.ct) {
    status.add("CT revision", held.ct->revision);
    status.add("CT loaded", stamp_and_age(held.ct->header.stamp, now));
  } else {
    status.add("CT revision", "none");
  }
  status.add("ultrasound volumes held", held.ultrasound_volumes);
  if (held.newest_ultrasound)
    status.add("newest ultrasound", stamp_and_age(held.newest_ultrasound->stamp, now));
  if (held.ct_refusal) status.mergeSummary(DiagnosticStatus::ERROR, held.ct_refusal->what());
  if (held.newest_ultrasound_refusal)
    status.mergeSummary(DiagnosticStatus::ERROR, held.newest_ultrasound_refusal->what());
  if (!held.ct && !held.ct_refusal)
    status.mergeSummary(DiagnosticStatus::WARN, "no CT was received");
  if (held.ultrasound_volumes == 0)
    status.mergeSummary(DiagnosticStatus::WARN, "no ultrasound was received");
}

}  // namespace

void RegistrationStatistics::count(const us_ct_registration::RegistrationResult& result,
                                   bool continuous, const ::ros::Time& now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  last_ = result;
  if (result.status.code == Status::REGISTERED)
    ++registered_;
  else
    ++refusals_[result.status.code];
  if (!continuous) return;
  continuous_ends_.push_back(Clock::now());
  continuous_age_s_ = seconds_between(result.header.stamp, now);
  while (continuous_ends_.back() - continuous_ends_.front() > kRateWindow)
    continuous_ends_.pop_front();
}

double RegistrationStatistics::rate_hz() const {
  if (continuous_ends_.size() < 2 || Clock::now() - continuous_ends_.back() > kRateWindow)
    return 0.0;
  const std::chrono::duration<double> span = continuous_ends_.back() - continuous_ends_.front();
  return static_cast<double>(continuous_ends_.size() - 1) / span.count();
}

void RegistrationStatistics::describe_last(DiagnosticStatusWrapper& status) const {
  status.add("registered", registered_);
  for (const auto& [code, count] : refusals_) status.add("refused " + code_name(code), count);
  if (!last_) return;
  status.add("last result", last_->id);
  status.add("last status", code_name(last_->status.code));
  status.add("last reason", last_->status.message);
  if (last_->status.code != Status::REGISTERED)
    status.mergeSummary(DiagnosticStatus::WARN,
                        code_name(last_->status.code) + ": " + last_->status.message);
  if (continuous_ends_.empty()) return;
  status.addf("continuous rate, Hz", "%.2f", rate_hz());
  status.addf("continuous age, s", "%.3f", continuous_age_s_);
}

void RegistrationStatistics::describe(const HeldState& held, const std::string& running,
                                      const ::ros::Time& now,
                                      DiagnosticStatusWrapper& status) const {
  const std::string state = running.empty() ? "idle" : "running: " + running;
  status.summary(DiagnosticStatus::OK, state);
  status.add("state", state);
  describe_held(held, now, status);
  const std::lock_guard<std::mutex> lock(mutex_);
  describe_last(status);
}

}  // namespace usct::ros_interface
