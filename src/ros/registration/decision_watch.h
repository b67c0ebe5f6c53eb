#pragma once

#include <us_ct_registration/Alignment.h>

#include <chrono>
#include <mutex>

namespace usct::ros_interface {

/// Knows whether a person has to decide about a result, so that no continuous registration puts
/// another in its place meanwhile: a result may wait since before this process began. May be called
/// from any thread.
class DecisionWatch {
 public:
  using Clock = std::chrono::steady_clock;
  /// tf_publisher says within this time that it has a result, also to a process that begins.
  static constexpr std::chrono::seconds kOnItsWay{2};

  explicit DecisionWatch(Clock::time_point begun) : begun_(begun) {}

  /// Must be called before a registered result is published.
  void offered(Clock::time_point now);
  /// Takes what tf_publisher says.
  void arrived(const us_ct_registration::Alignment& alignment);
  /// Whether tf_publisher has the policy `confirm`, and a result waits or is on its way to it; or
  /// whether it has said nothing yet and may still do so.
  bool is_awaited(Clock::time_point now) const;

 private:
  const Clock::time_point begun_;
  mutable std::mutex mutex_;  // guards all below
  bool was_heard_ = false;
  bool needs_person_ = false;
  bool waits_ = false;
  Clock::time_point on_its_way_until_{};
};

}  // namespace usct::ros_interface
