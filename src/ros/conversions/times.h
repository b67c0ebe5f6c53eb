#pragma once

#include <ros/time.h>

#include <algorithm>
#include <cstdint>
#include <string>

/// Times between the core (nanoseconds since 1970) and messages, and their differences.
namespace usct::ros_interface {

/// A stamp may be this far ahead of the node's clock: more than clocks of two machines that work
/// together differ, and more than tf is post-dated.
constexpr double kMostAheadS = 30.0;

inline std::int64_t nanoseconds_from(const ::ros::Time& time) {
  return static_cast<std::int64_t>(time.toNSec());
}

/// Throws std::runtime_error for times before 1970 or after 2106.
inline ::ros::Time time_from(std::int64_t nanoseconds) {
  return ::ros::Time().fromNSec(static_cast<std::uint64_t>(nanoseconds));
}

/// Seconds from `earlier` to `later`, negative if they come in the other order. The difference of
/// two ros::Times throws if it is more than 68 years, and a stamp in a message may be any.
inline double seconds_between(const ::ros::Time& earlier, const ::ros::Time& later) {
  constexpr double kSecondsPerNanosecond = 1e-9;
  return kSecondsPerNanosecond *
         static_cast<double>(nanoseconds_from(later) - nanoseconds_from(earlier));
}

/// `time` plus `seconds`, which must be finite and at most a few years; the nearest time that
/// exists if the sum is before 1970 or after 2106. The sum of ros::Time and ros::Duration throws
/// there.
::ros::Time shifted(const ::ros::Time& time, double seconds);

/// ISO 8601 in UTC to the millisecond, like 2024-05-17T09:30:00.250Z.
std::string utc_text(const ::ros::Time& time);

/// Throws InputError, naming `source` and `field`, if the stamp is more than `kMostAheadS` ahead of
/// `now`. Nothing is known of the time while `now` is 0, before simulated time begins.
void require_not_ahead(const ::ros::Time& stamp, const ::ros::Time& now, const std::string& source,
                       const std::string& field);

/// The same for the stamp of a header, which must not be 0 either: tf would give its newest
/// transform.
void require_stamped(const ::ros::Time& stamp, const ::ros::Time& now, const std::string& source);

/// Whether the clock ran back, by more than two threads may differ that read it one after the
/// other.
inline bool ran_back(const ::ros::Time& now, const ::ros::Time& before) {
  constexpr double kThreadsS = 0.1;
  return seconds_between(now, before) > kThreadsS;
}

/// Milliseconds since 1970 by the wall clock, as the ids of results are.
std::uint64_t wall_time_ms();

/// A stamp for what comes at `now`. Simulated time is 0 before it begins, which is no valid stamp;
/// the least one is taken then, since all that comes later is newer.
inline ::ros::Time valid_stamp(const ::ros::Time& now) { return std::max(now, ::ros::TIME_MIN); }

/// Like "1234.567 (2.000 s ago)". What was stamped before simulated time began has no age.
std::string stamp_and_age(const ::ros::Time& stamp, const ::ros::Time& now);

/// Seconds with three decimals, like "1234.567".
std::string seconds_text(double seconds);
std::string seconds_text(const ::ros::Time& time);

}  // namespace usct::ros_interface
