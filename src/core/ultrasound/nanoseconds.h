#pragma once

#include <cmath>
#include <cstdint>

/// Stamps are whole nanoseconds since 1970; durations are seconds.
namespace usct {

constexpr std::int64_t kNanosecondsPerSecond = 1000000000;

/// Converts whole seconds and the remainder separately, as clocks that count both do, so that the
/// result has the same bits as theirs.
inline double seconds_from(std::int64_t nanoseconds) {
  std::int64_t whole = nanoseconds / kNanosecondsPerSecond;
  std::int64_t rest = nanoseconds % kNanosecondsPerSecond;
  if (rest < 0) {
    rest += kNanosecondsPerSecond;
    --whole;
  }
  return static_cast<double>(whole) + 1e-9 * static_cast<double>(rest);
}

inline std::int64_t nanoseconds_from(double seconds) {
  const double whole = std::floor(seconds);
  return static_cast<std::int64_t>(whole) * kNanosecondsPerSecond +
         static_cast<std::int64_t>(std::round((seconds - whole) * 1e9));
}

}  // namespace usct
