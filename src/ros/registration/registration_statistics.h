#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <us_ct_registration/RegistrationResult.h>

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>

#include "ros/registration/held_volumes.h"

namespace usct::ros_interface {

/// Counts how registrations ended, for diagnostics. May be called from any thread.
class RegistrationStatistics {
 public:
  /// `continuous`: whether the registration was run without a request.
  void count(const us_ct_registration::RegistrationResult& result, bool continuous,
             const ::ros::Time& now);

  /// Fills summary and values. `running` is the name of the registration that runs, empty if none
  /// does.
  void describe(const HeldState& held, const std::string& running, const ::ros::Time& now,
                diagnostic_updater::DiagnosticStatusWrapper& status) const;

 private:
  using Clock = std::chrono::steady_clock;

  double rate_hz() const;
  void describe_last(diagnostic_updater::DiagnosticStatusWrapper& status) const;

  mutable std::mutex mutex_;
  std::optional<us_ct_registration::RegistrationResult> last_;
  std::map<std::uint8_t, int> refusals_;
  int registered_ = 0;
  std::deque<Clock::time_point> continuous_ends_;
  double continuous_age_s_ = 0.0;
};

}  // namespace usct::ros_interface
