#pragma once

#include <ros/time.h>
#include <us_ct_registration/Acquisition.h>

#include <chrono>
#include <optional>

#include "ros/refusal.h"

namespace usct::ros_interface {

/// The newest ultrasound that was announced, and whether its volume has arrived. A request for the
/// newest ultrasound that comes before that would get the volume before, which shows another place.
///
/// Not thread-safe. Stamps must be of one clock: `forget` them all when it runs back.
class Acquisitions {
 public:
  using Clock = std::chrono::steady_clock;
  /// How long a volume may be on its way, and how long a request waits for a sweep to end.
  static constexpr std::chrono::seconds kPatience{2};

  void announced(const us_ct_registration::Acquisition& acquisition, Clock::time_point now);
  void arrived(const ::ros::Time& stamp, Clock::time_point now);
  void forget();

  /// Of the volume that arrived last; 0: none.
  const ::ros::Time& last_arrived() const { return last_arrived_; }
  /// A stamp that a request at this time has to wait for: it gets no ultrasound from before it.
  std::optional<::ros::Time> awaited(Clock::time_point now) const;
  /// Whether the wait for this stamp has ended, because the ultrasound has arrived or time ran
  /// back.
  bool has_ended(const ::ros::Time& awaited) const;
  /// Why a request that came at `asked` waits no longer; empty if it does.
  std::optional<Refusal> refusal(Clock::time_point asked, Clock::time_point now) const;

 private:
  std::optional<us_ct_registration::Acquisition> newest_;  // unless its volume has arrived
  Clock::time_point heard_;                                // when it was announced
  ::ros::Time last_arrived_;
};

}  // namespace usct::ros_interface
