#pragma once

#include <ros/time.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace usct::ros_interface {

/// A stretch of time in which no transform of a frame has a stamp; those at its ends have.
struct TfGap {
  ::ros::Time begin;
  ::ros::Time end;
};

/// Remembers the gaps in the transforms of each frame. Not to be used by several threads at once.
class TfGaps {
 public:
  /// Only gaps that last longer than `longest_s` count; 0: none does. A gap is forgotten when its
  /// end is `history_s` older than the newest transform of the frame.
  TfGaps(double longest_s, double history_s);

  /// A transform of the frame `child` has this stamp. It may arrive late, and then fills a gap.
  void heard(const std::string& child, const ::ros::Time& stamp);
  void clear() { frames_.clear(); }
  /// The gap of the frame `child` in which the stamp lies. The ends of a gap lie outside of it.
  std::optional<TfGap> find(const std::string& child, const ::ros::Time& stamp) const;

 private:
  struct Frame {
    ::ros::Time first;
    ::ros::Time last;
    std::map<::ros::Time, ::ros::Time> gaps;  // ends by their beginning
  };

  void note(const ::ros::Time& begin, const ::ros::Time& end, Frame& frame) const;

  const std::int64_t longest_ns_;
  const std::int64_t history_ns_;
  std::map<std::string, Frame> frames_;
};

}  // namespace usct::ros_interface
