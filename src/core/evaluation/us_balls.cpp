#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "order_statistics.h"
#include "require.h"
#include "us_ct_registration/evaluation/ball_detection.h"
#include "us_ct_registration/geometry/beam_grid.h"

namespace usct {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// The offset, -0.5 to 0.5, of the maximum of a parabola through three values at -1, 0 and 1.
double parabola_offset(double before, double middle, double after) {
  const double curvature = before - 2.0 * middle + after;
  return curvature < 0.0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

/// Echoes of balls in the samples; indices are (sample, line, frame).
class EchoSearch {
 public:
  EchoSearch(const PreScanVolume& ultrasound, const UsBallOptions& options)
      : us_(ultrasound),
        options_(options),
        beams_(beam_grid(ultrasound.geometry)),
        size_(beams_.samples(), beams_.lines, beams_.frames) {
    depth_reach_ = std::max(1, static_cast<int>(std::ceil(kEchoDepthMm / beams_.axial.spacing_mm)));
  }

  BallDetection search() const {
    BallDetection found;
    for (int frame = 0; frame < size_.z(); ++frame)
      for (int line = 0; line < size_.y(); ++line)
        for (int sample = 0; sample < size_.x(); ++sample) add({sample, line, frame}, found);
    std::sort(found.balls.begin(), found.balls.end(),
              [](const DetectedBall& a, const DetectedBall& b) { return a.contrast > b.contrast; });
    return found;
  }

 private:
  /// The echo's extent along the beam, in which its depth varies over the lines and frames.
  static constexpr double kEchoDepthMm = 1.5;

  bool is_inside(const Vector3i& v) const {
    return (v.array() >= 0).all() && (v.array() < size_.array()).all();
  }
  int value(const Vector3i& v) const { return us_.at(v.x(), v.y(), v.z()); }
  Vector3d point(const Vector3i& v) const { return beams_.point(v.z(), v.y(), v.x()); }

  /// The number of lines (axis 1) or frames (axis 2) that span `reach_mm` at a voxel.
  int count_of(const Vector3i& v, int axis, double reach_mm) const {
    Vector3i beside = v;
    beside[axis] += v[axis] + 1 < size_[axis] ? 1 : -1;
    if (!is_inside(beside)) return 0;
    const double pitch_mm = std::max((point(beside) - point(v)).norm(), 1e-3);
    return std::min(size_[axis], static_cast<int>(std::ceil(reach_mm / pitch_mm)));
  }

  /// The brightest value of a line of sight over the depths of an echo.
  int brightest(Vector3i v) const {
    int most = 0;
    const int middle = v.x();
    for (v.x() = std::max(0, middle - depth_reach_);
         v.x() <= std::min(size_.x() - 1, middle + depth_reach_); ++v.x())
      most = std::max(most, value(v));
    return most;
  }

  void add(const Vector3i& v, BallDetection& found) const {
    if (value(v) < options_.least_contrast) return;
    const int lines = count_of(v, 1, options_.echo_radius_mm);
    const int frames = count_of(v, 2, options_.echo_radius_mm);
    if (!is_brightest_within(v, lines, frames)) return;
    const double contrast = value(v) - surroundings(v, lines, frames);
    if (contrast < options_.least_contrast) return;
    const std::optional<Vector3d> top = top_index(v, lines, frames);
    if (!top) {
      found.refused.push_back({point(v), "is cut by the border of the ultrasound"});
      return;
    }
    // The centre lies behind the top along the beam.
    const Vector3d top_mm = us_point(*top);
    const Vector3d deeper_mm = us_point(*top + Vector3d::UnitX());
    found.balls.push_back(
        {top_mm + 0.5 * options_.diameter_mm * (deeper_mm - top_mm).normalized(), contrast});
  }

  /// Whether no other voxel of the echo's extent is brighter; of several equal ones, in a saturated
  /// echo, the first counts.
  bool is_brightest_within(const Vector3i& v, int lines, int frames) const {
    for (int f = -frames; f <= frames; ++f)
      for (int l = -lines; l <= lines; ++l)
        for (int s = -depth_reach_; s <= depth_reach_; ++s) {
          const Vector3i other = v + Vector3i(s, l, f);
          if (!is_inside(other)) continue;
          const bool is_before = std::make_tuple(f, l, s) < std::make_tuple(0, 0, 0);
          if (value(other) > value(v) || (is_before && value(other) == value(v))) return false;
        }
    return true;
  }

  /// The 90th percentile of the values beside the echo, from its radius to 1.3 times that, and of
  /// those above it: an interface is bright beside, a speckle among others both.
  double surroundings(const Vector3i& v, int lines, int frames) const {
    std::vector<int> values;
    const auto most_lines = static_cast<int>(std::ceil(1.3 * lines));
    const auto most_frames = static_cast<int>(std::ceil(1.3 * frames));
    for (int f = -most_frames; f <= most_frames; ++f)
      for (int l = -most_lines; l <= most_lines; ++l) {
        const Vector3i other = v + Vector3i(0, l, f);
        const double distance = std::hypot(static_cast<double>(l) / std::max(lines, 1),
                                           static_cast<double>(f) / std::max(frames, 1));
        if (distance >= 1.0 && distance <= 1.3 && is_inside(other))
          values.push_back(brightest(other));
      }
    for (int s = 2 * depth_reach_; s <= 4 * depth_reach_; ++s)
      if (is_inside(v - Vector3i(s, 0, 0))) values.push_back(value(v - Vector3i(s, 0, 0)));
    if (values.empty()) return 255.0;
    return value_of_rank(values, values.size() * 9 / 10);
  }

  /// The echo's position between the samples, lines and frames; none if the echo reaches a border.
  std::optional<Vector3d> top_index(const Vector3i& v, int lines, int frames) const {
    const double level = 0.6 * value(v);
    double sum = 0.0;
    Vector3d moment = Vector3d::Zero();
    for (int f = -frames; f <= frames; ++f)
      for (int l = -lines; l <= lines; ++l) {
        const Vector3i other = v + Vector3i(0, l, f);
        if (!is_inside(other)) continue;
        const double weight = brightest(other) - level;
        if (weight <= 0.0) continue;
        const bool at_border = other.y() == 0 || other.y() + 1 == size_.y() || other.z() == 0 ||
                               other.z() + 1 == size_.z();
        if (at_border) return std::nullopt;
        sum += weight;
        moment += weight * other.cast<double>();
      }
    if (v.x() == 0 || v.x() + 1 == size_.x() || !(sum > 0.0)) return std::nullopt;
    Vector3d index = moment / sum;
    index.x() = v.x() + parabola_offset(value(v - Vector3i::UnitX()), value(v),
                                        value(v + Vector3i::UnitX()));
    return index;
  }

  /// Position of an index between lines and frames, mm, by the nearest four beams: poses of tracked
  /// frames have no formula between them.
  Vector3d us_point(const Vector3d& index) const {
    const int line = std::min(static_cast<int>(index.y()), size_.y() - 2);
    const int frame = std::min(static_cast<int>(index.z()), std::max(0, size_.z() - 2));
    const double a = index.y() - line;
    const double b = size_.z() > 1 ? index.z() - frame : 0.0;
    const auto along_lines = [&](int f) -> Vector3d {
      return (1.0 - a) * beams_.point(f, line, index.x()) +
             a * beams_.point(f, line + 1, index.x());
    };
    if (b == 0.0) return along_lines(frame);
    return (1.0 - b) * along_lines(frame) + b * along_lines(frame + 1);
  }

  const PreScanVolume& us_;
  const UsBallOptions& options_;
  BeamGrid beams_;
  Vector3i size_;
  int depth_reach_ = 1;
};

}  // namespace

void UsBallOptions::validate() const {
  require_within("ball options", "diameter_mm", diameter_mm, 0.3, 10.0);
  require_within("ball options", "least_contrast", least_contrast, 1.0, 255.0);
  require_within("ball options", "echo_radius_mm", echo_radius_mm, 1.0, 50.0);
}

BallDetection detect_balls(const PreScanVolume& ultrasound, const UsBallOptions& options) {
  options.validate();
  ultrasound.validate("ultrasound");
  return EchoSearch(ultrasound, options).search();
}

}  // namespace usct
