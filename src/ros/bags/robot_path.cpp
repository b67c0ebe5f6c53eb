#include "ros/bags/robot_path.h"

#include <algorithm>
#include <cmath>

namespace usct::ros_interface {
namespace {

using Eigen::Isometry3d;
using ::ros::Duration;
using ::ros::Time;

constexpr double kStillS = 0.4;
constexpr double kMoveS = 1.0;
constexpr double kTfPeriodS = 0.02;

/// The pose moved backwards by `distance_mm` along the probe's axis.
Isometry3d retracted(const Isometry3d& T, double distance_mm) {
  return T * Eigen::Translation3d(0.0, -distance_mm, 0.0);
}

/// Adds the departure after a sweep's last pose (direction 1), or the arrival before its first one
/// (-1). Next to the sweep the probe stands still for a moment.
void add_departure(const StampedPose& from, double duration_s, int direction, double retract_mm,
                   std::vector<StampedPose>& path) {
  const int steps = static_cast<int>(std::lround(duration_s / kTfPeriodS));
  for (int step = 1; step <= steps; ++step) {
    const double since_s = step * kTfPeriodS;
    const double moved = std::clamp((since_s - kStillS) / kMoveS, 0.0, 1.0);
    path.push_back(
        {from.stamp + Duration(direction * since_s), retracted(from.T, moved * retract_mm)});
  }
}

}  // namespace

std::vector<StampedPose> robot_path(const std::vector<std::vector<StampedPose>>& sweeps,
                                    double pause_s, double retract_mm) {
  std::vector<StampedPose> path;
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    // The arrival begins one step later, so that it has no stamp in common with the departure.
    const double before_s = i == 0 ? kArrivalS : pause_s / 2.0 - kTfPeriodS;
    const double after_s = i + 1 == sweeps.size() ? pause_s : pause_s / 2.0;
    add_departure(sweeps[i].front(), before_s, -1, retract_mm, path);
    path.insert(path.end(), sweeps[i].begin(), sweeps[i].end());
    add_departure(sweeps[i].back(), after_s, +1, retract_mm, path);
  }
  return path;
}

std::vector<StampedPose> held(const Isometry3d& T, const Time& first, const Time& last) {
  std::vector<StampedPose> poses;
  for (Time t = first; t < last; t += Duration(kTfPeriodS)) poses.push_back({t, T});
  poses.push_back({last, T});
  return poses;
}

}  // namespace usct::ros_interface
