#pragma once

#include <us_ct_registration/Alignment.h>

#include <chrono>
#include <mutex>

namespace usct::ros_interface {

/// Knows whether a person has to decide about a result, so that no continuous registration puts
/// another in its place meanwhile. May be called from any thread.
class DecisionWatch {
 public:
  using Clock = std::chrono::steady_clock;
  /// tf_publisher says within this time that it has a result.
  static constexpr std::chrono::seconds kOnItsWay{2};

  /// Must be called before a registered result is published.
  void offered(Clock::time_point now);
  /// Takes what tf_publisher says.
  void arrived(const us_ct_registration::Alignment& alignment);
  /// Whether tf_publisher has the policy `confirm`, and a result waits or is on its way to it.
  bool is_awaited(Clock::time_point now) const;

 private:
  mutable std::mutex mutex_;  // guards all below
  bool needs_person_ = false;
  bool waits_ = false;
  Clock::time_point on_its_way_until_{};
};

}  // namespace usct::ros_interface
