#pragma once

#include <ros/time.h>
#include <us_ct_registration/Alignment.h>

#include <Eigen/Geometry>
#include <chrono>
#include <optional>
#include <string>

#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {

/// The CT as an alignment places it.
struct AlignedCt {
  std::string fixed_frame;
  std::string ct_frame;
  Eigen::Isometry3d T_fixed_ct = Eigen::Isometry3d::Identity();
};

/// The pose of the CT in the fixed frame at a stamp, mm, as tf has it. Throws
/// tf2::TransformException if tf does not know it, InputError if it is not rigid, and a Refusal
/// with TF_STALE if it is another one than that of the alignment: look-ups still show the alignment
/// before, or another publisher is at work.
Eigen::Isometry3d T_fixed_ct_in_tf(const TfBuffer& tf, const AlignedCt& aligned,
                                   const ::ros::Time& stamp);

/// Knows whether the alignment that tf_publisher has announced is in tf as well. When tf_publisher
/// has died, its last announcement remains, but look-ups at the present time fail.
///
/// tf may be without the alignment for `kPatience`: after a switch, look-ups find the alignment
/// before for as long as that was post-dated, and after a jump of time, or before a node listens to
/// tf, they find none. This time is that of the wall, because simulated time may jump. Where
/// simulated time stands still, look-ups at the present time go on to find the alignment. Not
/// synchronised.
class AlignmentWatch {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kPatience{1000};
  /// Nodes look at tf with this period, s.
  static constexpr double kPeriod_s = 0.1;

  /// Takes what tf_publisher says. Another alignment than the one before counts until tf has been
  /// without it for too long.
  void arrived(const us_ct_registration::Alignment& alignment);
  /// Looks the CT up at the present time `now`. Returns whether `problem` is another one than
  /// before.
  bool look_up(const TfBuffer& tf, const ::ros::Time& now, Clock::time_point wall_now);
  /// The CT as the announced alignment places it; empty if none is announced.
  const std::optional<AlignedCt>& aligned() const { return aligned_; }
  /// Why the announced alignment is not in force, in words that are the same at each look-up; empty
  /// if it is in force or if none is announced.
  const std::string& problem() const { return problem_; }

 private:
  std::optional<AlignedCt> aligned_;  // empty: nothing is announced that could be in tf
  std::optional<Clock::time_point> missing_since_;
  std::string problem_;
};

}  // namespace usct::ros_interface
