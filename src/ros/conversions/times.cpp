#include "ros/conversions/times.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct::ros_interface {

::ros::Time shifted(const ::ros::Time& time, double seconds) {
  constexpr double kNanosecondsPerSecond = 1e9;
  const std::int64_t sum = nanoseconds_from(time) +
                           static_cast<std::int64_t>(std::llround(kNanosecondsPerSecond * seconds));
  return time_from(std::clamp(sum, std::int64_t{0}, nanoseconds_from(::ros::TIME_MAX)));
}

void require_not_ahead(const ::ros::Time& stamp, const ::ros::Time& now, const std::string& source,
                       const std::string& field) {
  const double ahead_s = seconds_between(now, stamp);
  if (now.isZero() || ahead_s <= kMostAheadS) return;
  throw InputError(
      source, "'" + field + "' is " + seconds_text(stamp) + " s, " + seconds_text(ahead_s) +
                  " s ahead of this node's clock, must be at most " + seconds_text(kMostAheadS) +
                  " s ahead: the stamp is wrong, or the clocks disagree");
}

void require_stamped(const ::ros::Time& stamp, const ::ros::Time& now, const std::string& source) {
  if (stamp.isZero()) throw InputError(source, "'header.stamp' is 0, must be set");
  require_not_ahead(stamp, now, source, "header.stamp");
}

std::string utc_text(const ::ros::Time& time) {
  const std::time_t seconds = time.sec;
  std::tm date{};
  gmtime_r(&seconds, &date);
  constexpr unsigned kNanosecondsPerMs = 1000000;
  return formatted("%04d-%02d-%02dT%02d:%02d:%02d.%03uZ", date.tm_year + 1900, date.tm_mon + 1,
                   date.tm_mday, date.tm_hour, date.tm_min, date.tm_sec,
                   time.nsec / kNanosecondsPerMs);
}

std::uint64_t wall_time_ms() {
  constexpr std::uint64_t kNsPerMs = 1'000'000;
  return ::ros::WallTime::now().toNSec() / kNsPerMs;
}

std::string stamp_and_age(const ::ros::Time& stamp, const ::ros::Time& now) {
  if (stamp <= ::ros::TIME_MIN) return "before the clock began";
  return seconds_text(stamp) + " (" + seconds_text(seconds_between(stamp, now)) + " s ago)";
}

std::string seconds_text(double seconds) { return formatted("%.3f", seconds); }

std::string seconds_text(const ::ros::Time& time) { return seconds_text(time.toSec()); }

}  // namespace usct::ros_interface
