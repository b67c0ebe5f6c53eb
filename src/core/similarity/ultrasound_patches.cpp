#include "us_ct_registration/similarity/ultrasound_patches.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "simulation/require.h"

namespace usct {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// Deviation over which ultrasound (in units of its own deviation) is taken for constant.
constexpr double kLeastDeviation = 1e-4;

/// How far and whereto frames move if the sweep is longer than recorded. The parameter along the
/// sweep is the path of the middle of the field, smoothed since tracked poses jitter.
class SweepMotion {
 public:
  explicit SweepMotion(const BeamGrid& beams)
      : beams_(beams), window_(std::max(1, beams.frames / 10)) {
    std::vector<Vector3d> centres;
    for (int f = 0; f < beams.frames; ++f) centres.push_back(smoothed_centre(f));
    path_mm_.push_back(0.0);
    for (std::size_t f = 1; f < centres.size(); ++f)
      path_mm_.push_back(path_mm_.back() + (centres[f] - centres[f - 1]).norm());
  }

  /// Motion per unit of error, mm.
  Vector3d operator()(int frame, int line, int sample) const {
    const int before = std::max(0, frame - window_);
    const int after = std::min(beams_.frames - 1, frame + window_);
    const double step_mm = path_mm(after) - path_mm(before);
    if (!(step_mm > 0.0)) return Vector3d::Zero();
    const double from_middle_mm = path_mm(frame) - 0.5 * path_mm_.back();
    return from_middle_mm / step_mm *
           (beams_.point(after, line, sample) - beams_.point(before, line, sample));
  }

 private:
  double path_mm(int frame) const { return path_mm_[static_cast<std::size_t>(frame)]; }

  Vector3d smoothed_centre(int frame) const {
    Vector3d sum = Vector3d::Zero();
    const int first = std::max(0, frame - window_);
    const int last = std::min(beams_.frames - 1, frame + window_);
    for (int f = first; f <= last; ++f)
      sum += beams_.point(f, beams_.lines / 2, 0.5 * beams_.samples());
    return sum / (last - first + 1);
  }

  const BeamGrid& beams_;
  int window_;
  std::vector<double> path_mm_;
};

/// Samples, lines and frames along each edge of a patch.
Vector3i patch_size(const BeamGrid& beams, const PatchOptions& options) {
  const double middle = 0.5 * (beams.samples() - 1);
  const auto steps = [](double edge_mm, double step_mm, int available) {
    if (!(step_mm > 0.0)) return available;
    return static_cast<int>(std::clamp(std::round(edge_mm / step_mm), 1.0, double(available)));
  };
  const auto distance = [&](int f_a, int l_a, int f_b, int l_b) {
    return (beams.point(f_a, l_a, middle) - beams.point(f_b, l_b, middle)).norm();
  };
  const int f = beams.frames / 2;
  const int l = beams.lines / 2;
  double line_mm = 0.0;
  for (int i = 1; i < beams.lines; ++i) line_mm += distance(f, i - 1, f, i) / (beams.lines - 1);
  double frame_mm = 0.0;
  for (int i = 1; i < beams.frames; ++i) frame_mm += distance(i - 1, l, i, l) / (beams.frames - 1);
  return {steps(options.depth_mm, beams.axial.spacing_mm, beams.samples()),
          steps(options.lateral_mm, line_mm, beams.lines),
          steps(options.elevation_mm, frame_mm, beams.frames)};
}

class Cutter {
 public:
  Cutter(const BeamUltrasound& ultrasound, const PatchOptions& options)
      : us_(ultrasound), options_(options), motion_(ultrasound.beams) {}

  UltrasoundPatches run() {
    const BeamGrid& beams = us_.beams;
    const Vector3i size = patch_size(beams, options_);
    for (int f = 0; f < beams.frames; f += size.z())
      for (int l = 0; l < beams.lines; l += size.y())
        for (int s = 0; s < beams.samples(); s += size.x())
          add_patch({s, l, f},
                    {std::min(s + size.x(), beams.samples()), std::min(l + size.y(), beams.lines),
                     std::min(f + size.z(), beams.frames)});
    return std::move(result_);
  }

 private:
  struct Place {
    int sample, line, frame;
    std::size_t offset;
  };

  void add_patch(const Vector3i& begin, const Vector3i& end) {
    inside_.clear();
    for (int f = begin.z(); f < end.z(); ++f)
      for (int l = begin.y(); l < end.y(); ++l)
        for (int s = begin.x(); s < end.x(); ++s) {
          const std::size_t offset =
              (static_cast<std::size_t>(f) * static_cast<std::size_t>(us_.beams.lines) +
               static_cast<std::size_t>(l)) *
                  static_cast<std::size_t>(us_.beams.samples()) +
              static_cast<std::size_t>(s);
          if (us_.known.empty() || us_.known[offset] != 0) inside_.push_back({s, l, f, offset});
        }
    const double places = (end - begin).cast<double>().prod();
    if (inside_.size() < 2 || static_cast<double>(inside_.size()) < options_.least_share * places)
      return;
    UltrasoundPatches::Patch patch{result_.value.size(), inside_.size(), 0.0, 0.0};
    for (const Place& place : inside_) patch.mean += us_.brightness[place.offset];
    patch.mean /= static_cast<double>(patch.count);
    for (const Place& place : inside_) {
      const double difference = us_.brightness[place.offset] - patch.mean;
      patch.square_sum += difference * difference;
    }
    if (patch.square_sum <= kLeastDeviation * kLeastDeviation * static_cast<double>(patch.count))
      return;
    for (const Place& place : inside_) add_sample(place, patch.mean);
    fill_up(patch);
    result_.count += patch.count;
    result_.patches.push_back(patch);
  }

  void add_sample(const Place& place, double mean) {
    const Beam& beam = us_.beams.beam(place.frame, place.line);
    const double depth_mm = us_.beams.axial.depth_mm(place.sample);
    push(beam.origin_mm + depth_mm * beam.direction, result_.x_mm, result_.y_mm, result_.z_mm);
    push(beam.direction, result_.direction_x, result_.direction_y, result_.direction_z);
    push(motion_(place.frame, place.line, place.sample), result_.sweep_x, result_.sweep_y,
         result_.sweep_z);
    result_.depth_mm.push_back(static_cast<float>(depth_mm));
    result_.value.push_back(static_cast<float>(us_.brightness[place.offset] - mean));
  }

  void fill_up(const UltrasoundPatches::Patch& patch) {
    const std::size_t size = patch.begin + patch.padded();
    for (auto* values : {&result_.x_mm, &result_.y_mm, &result_.z_mm})
      values->resize(size, UltrasoundPatches::kNowhere);
    for (auto* values :
         {&result_.direction_x, &result_.direction_y, &result_.direction_z, &result_.sweep_x,
          &result_.sweep_y, &result_.sweep_z, &result_.depth_mm, &result_.value})
      values->resize(size, 0.0F);
  }

  static void push(const Vector3d& vector, std::vector<float>& x, std::vector<float>& y,
                   std::vector<float>& z) {
    x.push_back(static_cast<float>(vector.x()));
    y.push_back(static_cast<float>(vector.y()));
    z.push_back(static_cast<float>(vector.z()));
  }

  const BeamUltrasound& us_;
  const PatchOptions& options_;
  SweepMotion motion_;
  std::vector<Place> inside_;
  UltrasoundPatches result_;
};

}  // namespace

void PatchOptions::validate(const std::string& source) const {
  require(depth_mm > 0.0, source, "depth_mm", depth_mm, "> 0");
  require(lateral_mm > 0.0, source, "lateral_mm", lateral_mm, "> 0");
  require(elevation_mm > 0.0, source, "elevation_mm", elevation_mm, "> 0");
  require(least_share > 0.0 && least_share <= 1.0, source, "least_share", least_share,
          "within (0, 1]");
}

UltrasoundPatches cut_into_patches(const BeamUltrasound& ultrasound, const PatchOptions& options) {
  ultrasound.validate();
  options.validate();
  return Cutter(ultrasound, options).run();
}

}  // namespace usct
