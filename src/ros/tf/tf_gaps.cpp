#include "ros/tf/tf_gaps.h"

#include <cmath>

#include "ros/conversions/times.h"

namespace usct::ros_interface {
namespace {

std::int64_t nanoseconds(double seconds) {
  constexpr double kNanosecondsPerSecond = 1e9;
  return std::llround(kNanosecondsPerSecond * seconds);
}

std::int64_t nanoseconds_between(const ::ros::Time& earlier, const ::ros::Time& later) {
  return nanoseconds_from(later) - nanoseconds_from(earlier);
}

}  // namespace

TfGaps::TfGaps(double longest_s, double history_s)
    : longest_ns_(nanoseconds(longest_s)), history_ns_(nanoseconds(history_s)) {}

void TfGaps::note(const ::ros::Time& begin, const ::ros::Time& end, Frame& frame) const {
  if (nanoseconds_between(begin, end) > longest_ns_) frame.gaps[begin] = end;
}

void TfGaps::heard(const std::string& child, const ::ros::Time& stamp) {
  if (longest_ns_ == 0) return;
  const auto [found, is_new] = frames_.try_emplace(child, Frame{stamp, stamp, {}});
  if (is_new) return;
  Frame& frame = found->second;
  if (stamp > frame.last) {
    note(frame.last, stamp, frame);
    frame.last = stamp;
  } else if (stamp < frame.first) {
    note(stamp, frame.first, frame);
    frame.first = stamp;
  } else if (const std::optional<TfGap> filled = find(child, stamp)) {
    frame.gaps.erase(filled->begin);
    note(filled->begin, stamp, frame);
    note(stamp, filled->end, frame);
  }
  while (!frame.gaps.empty() &&
         nanoseconds_between(frame.gaps.begin()->second, frame.last) > history_ns_)
    frame.gaps.erase(frame.gaps.begin());
}

std::optional<TfGap> TfGaps::find(const std::string& child, const ::ros::Time& stamp) const {
  const auto frame = frames_.find(child);
  if (frame == frames_.end()) return std::nullopt;
  // The last gap that begins before the stamp.
  const std::map<::ros::Time, ::ros::Time>& gaps = frame->second.gaps;
  auto gap = gaps.lower_bound(stamp);
  if (gap == gaps.begin()) return std::nullopt;
  --gap;
  if (stamp >= gap->second) return std::nullopt;
  return TfGap{gap->first, gap->second};
}

}  // namespace usct::ros_interface
