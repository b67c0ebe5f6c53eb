#pragma once

#include <ros/time.h>
#include <us_ct_registration/Acquisition.h>

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>

#include "ros/node/refusal.h"

namespace usct::ros_interface {

/// The newest ultrasound that was announced, and whether its volume has arrived. A request for the
/// newest ultrasound that comes before that would get the volume before, which shows another place.
/// Announcements and volumes come by two topics, in any order.
///
/// Not thread-safe. Stamps must be of one clock: `forget` them all when it runs back.
class Acquisitions {
 public:
  using Clock = std::chrono::steady_clock;
  using Acquisition = us_ct_registration::Acquisition;
  /// How long a volume may be on its way.
  static constexpr std::chrono::seconds kPatience{2};
  /// How long a request waits for a sweep to end.
  static constexpr std::chrono::seconds kPatienceWithSweep{10};

  void announced(const Acquisition& acquisition, Clock::time_point now);
  void arrived(const ::ros::Time& stamp, Clock::time_point now);
  void forget();

  /// The stamp of the volume that arrived last; 0: none.
  ::ros::Time last_arrived() const { return arrived_.empty() ? ::ros::Time() : arrived_.back(); }
  /// A request at this time has to wait for this: it gets no ultrasound from before it.
  std::optional<Acquisition> awaited(Clock::time_point now) const;
  /// Whether the wait for it has ended, because its volume has arrived or time ran back.
  bool has_ended(const Acquisition& awaited) const;
  /// Why a request that came at `asked` waits no longer; empty if it does.
  std::optional<Refusal> refusal(Clock::time_point asked, Clock::time_point now) const;

 private:
  bool has_arrived(const ::ros::Time& stamp) const;

  std::optional<Acquisition> newest_;  // unless its volume has arrived
  Clock::time_point heard_;            // when it was announced
  std::uint64_t newest_id_ = 0;
  std::deque<::ros::Time> arrived_;  // stamps of the last volumes, in the order of arrival
};

}  // namespace usct::ros_interface
