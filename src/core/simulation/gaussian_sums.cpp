#include "simulation/gaussian_sums.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"

namespace usct {
namespace {

constexpr float kReach = 3.0F;  // in standard deviations

/// Distances along the polygon through the points of successive rows at the same sample.
template <typename PointAt>
std::vector<std::vector<float>> path_mm(int rows, int samples, const PointAt& point_at) {
  std::vector<std::vector<float>> path(static_cast<std::size_t>(rows));
  for (std::size_t row = 0; row < path.size(); ++row) {
    path[row].resize(static_cast<std::size_t>(samples));
    if (row == 0) continue;
    for (std::size_t s = 0; s < path[row].size(); ++s) {
      const Eigen::Vector3d step = point_at(static_cast<int>(row), static_cast<int>(s)) -
                                   point_at(static_cast<int>(row) - 1, static_cast<int>(s));
      path[row][s] = path[row - 1][s] + static_cast<float>(step.norm());
    }
  }
  return path;
}

void add_product(const float* weights, const float* values, int count, float* sum) {
  for (int s = 0; s < count; ++s) sum[s] += weights[s] * values[s];
}

}  // namespace

GaussianSums::GaussianSums(const BeamGrid& beams, double sigma_mm)
    : samples_(beams.samples()),
      lines_(beams.lines),
      frames_(beams.frames),
      sigma_mm_(static_cast<float>(sigma_mm)) {
  const auto spacing = static_cast<float>(beams.axial.spacing_mm);
  for (int i = 0; i < samples_ && static_cast<float>(i) * spacing <= kReach * sigma_mm_; ++i) {
    const float x = static_cast<float>(i) * spacing / sigma_mm_;
    kernel_.push_back(std::exp(-0.5F * x * x));
  }
  lines_mm_ = path_mm(lines_, samples_,
                      [&](int line, int sample) { return beams.point(frames_ / 2, line, sample); });
  frames_mm_ = path_mm(frames_, samples_, [&](int frame, int sample) {
    return beams.point(frame, lines_ / 2, sample);
  });
}

std::vector<float> GaussianSums::operator()(const std::vector<float>& values) const {
  return across_frames(across_lines(along_samples(values)));
}

std::vector<float> GaussianSums::along_samples(const std::vector<float>& values) const {
  std::vector<float> sums(values.size());
  parallel_for(frames_, [&](int frame) {
    for (int line = 0; line < lines_; ++line) {
      const std::size_t start =
          (static_cast<std::size_t>(frame) * static_cast<std::size_t>(lines_) +
           static_cast<std::size_t>(line)) *
          static_cast<std::size_t>(samples_);
      const float* in = values.data() + start;
      float* out = sums.data() + start;
      for (int s = 0; s < samples_; ++s) out[s] = kernel_[0] * in[s];
      for (int i = 1; i < static_cast<int>(kernel_.size()); ++i)
        for (int s = 0; s + i < samples_; ++s) {
          out[s] += kernel_[static_cast<std::size_t>(i)] * in[s + i];
          out[s + i] += kernel_[static_cast<std::size_t>(i)] * in[s];
        }
    }
  });
  return sums;
}

bool GaussianSums::weights(const Positions& positions, int from, int to,
                           std::vector<float>& result) const {
  const std::vector<float>& a = positions[static_cast<std::size_t>(from)];
  const std::vector<float>& b = positions[static_cast<std::size_t>(to)];
  result.resize(a.size());
  bool any = false;
  for (std::size_t s = 0; s < a.size(); ++s) {
    const float x = (a[s] - b[s]) / sigma_mm_;
    const bool within = std::abs(x) <= kReach;
    result[s] = within ? std::exp(-0.5F * x * x) : 0.0F;
    any = any || within;
  }
  return any;
}

std::vector<float> GaussianSums::across_lines(const std::vector<float>& values) const {
  std::vector<float> sums(values.size());
  const auto row = static_cast<std::size_t>(samples_);
  const std::size_t frame_size = row * static_cast<std::size_t>(lines_);
  parallel_for(lines_, [&](int line) {
    std::vector<float> weight;
    for (int other = 0; other < lines_; ++other) {
      if (!weights(lines_mm_, line, other, weight)) continue;
      for (std::size_t frame = 0; frame < static_cast<std::size_t>(frames_); ++frame)
        add_product(weight.data(),
                    values.data() + frame * frame_size + row * static_cast<std::size_t>(other),
                    samples_,
                    sums.data() + frame * frame_size + row * static_cast<std::size_t>(line));
    }
  });
  return sums;
}

std::vector<float> GaussianSums::across_frames(const std::vector<float>& values) const {
  std::vector<float> sums(values.size());
  const auto row = static_cast<std::size_t>(samples_);
  const std::size_t frame_size = row * static_cast<std::size_t>(lines_);
  parallel_for(frames_, [&](int frame) {
    std::vector<float> weight;
    for (int other = 0; other < frames_; ++other) {
      if (!weights(frames_mm_, frame, other, weight)) continue;
      for (std::size_t line = 0; line < static_cast<std::size_t>(lines_); ++line)
        add_product(weight.data(),
                    values.data() + static_cast<std::size_t>(other) * frame_size + line * row,
                    samples_,
                    sums.data() + static_cast<std::size_t>(frame) * frame_size + line * row);
    }
  });
  return sums;
}

}  // namespace usct
