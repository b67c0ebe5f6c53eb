#include "ultrasound/gaussian_sums.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "parallel.h"
#include "volume/combine_rows.h"

namespace usct {
namespace {

/// Half width of the window, in standard deviations.
constexpr double kReach = 3.0;
/// Greatest size of a block, in standard deviations.
constexpr double kLargestBlock = 0.8;

int block_size(double widest_mm, double sigma_mm) {
  if (!(widest_mm > 0.0)) return 1;
  return static_cast<int>(std::clamp(kLargestBlock * sigma_mm / widest_mm, 1.0, 64.0));
}

/// Variance of the window to apply to blocks of width `block_mm`, such that the blocks and the
/// interpolation widen it to sigma: a box has a variance of 1/12 of its squared width, linear
/// interpolation one of 1/6.
double variance_mm2(double sigma_mm, double block_mm, int block_size) {
  const double widened = block_size == 1 ? 0.0 : 0.25 * block_mm * block_mm;
  return sigma_mm * sigma_mm - widened;
}

/// Path length from the first point to each of `rows` points.
template <typename PointAt>
std::vector<double> path_mm(int rows, const PointAt& point_at) {
  std::vector<double> path{0.0};
  for (int row = 1; row < rows; ++row)
    path.push_back(path.back() + (point_at(row) - point_at(row - 1)).norm());
  return path;
}

/// Linear interpolation of a table, with extrapolation beyond its ends.
double interpolated_at(const std::vector<double>& table, double at) {
  if (table.size() < 2) return 0.0;
  const auto last = static_cast<double>(table.size() - 2);
  const auto i = static_cast<std::size_t>(std::clamp(std::floor(at), 0.0, last));
  return table[i] + (at - static_cast<double>(i)) * (table[i + 1] - table[i]);
}

template <typename PointAt>
double widest_step_mm(int rows, const PointAt& point_at) {
  double widest = 0.0;
  for (int row = 1; row < rows; ++row)
    widest = std::max(widest, (point_at(row) - point_at(row - 1)).norm());
  return widest;
}

}  // namespace

void GaussianSums::Blocks::between(int i, int& block, float& share) const {
  if (size == 1) {
    block = i;
    share = 0.0F;
    return;
  }
  const double at = (i + 0.5) / size + 0.5;
  block = static_cast<int>(at);
  share = static_cast<float>(at - block);
}

GaussianSums::GaussianSums(const BeamGrid& beams, double sigma_mm) : sigma_mm_(sigma_mm) {
  const int deepest = beams.samples() - 1;
  const auto on_line = [&](int line, double sample) {
    return beams.point(beams.frames / 2, line, sample);
  };
  const auto on_frame = [&](int frame, double sample) {
    return beams.point(frame, beams.lines / 2, sample);
  };
  const auto blocks = [&](int count, const auto& point_at) {
    const auto widest_at = [&](int sample) {
      return widest_step_mm(count, [&](int row) { return point_at(row, sample); });
    };
    return Blocks{count, block_size(std::max(widest_at(0), widest_at(deepest)), sigma_mm)};
  };
  const double spacing_mm = beams.axial.spacing_mm;
  samples_ = {beams.samples(), block_size(spacing_mm, sigma_mm)};
  lines_ = blocks(beams.lines, on_line);
  frames_ = blocks(beams.frames, on_frame);

  const double step_mm = spacing_mm * samples_.size;
  const double variance = variance_mm2(sigma_mm, step_mm, samples_.size);
  const int reach = static_cast<int>(kReach * std::sqrt(variance) / step_mm);
  for (int i = -reach; i <= reach; ++i)
    kernel_.push_back(static_cast<float>(std::exp(-0.5 * i * i * step_mm * step_mm / variance)));
  line_taps_ = taps_across(lines_, on_line);
  frame_taps_ = taps_across(frames_, on_frame);
}

template <typename PointAt>
GaussianSums::Taps GaussianSums::taps_across(const Blocks& rows, const PointAt& point_at) const {
  const auto count = static_cast<std::size_t>(rows.blocks());
  const auto samples = static_cast<std::size_t>(samples_.blocks());
  std::vector<float> position_mm(samples * count);  // rows fastest
  std::vector<float> factor(samples);               // exponent per squared distance
  parallel_for(samples_.blocks(), [&](int sample_block) {
    const auto s = static_cast<std::size_t>(sample_block);
    const double sample = samples_.middle(sample_block);
    const std::vector<double> path =
        path_mm(rows.count, [&](int row) { return point_at(row, sample); });
    for (std::size_t row = 0; row < count; ++row)
      position_mm[s * count + row] =
          static_cast<float>(interpolated_at(path, rows.middle(static_cast<int>(row))));
    const double block_mm = path.back() / std::max(1, rows.count - 1) * rows.size;
    factor[s] = static_cast<float>(-0.5 / variance_mm2(sigma_mm_, block_mm, rows.size));
  });
  constexpr auto kLeastExponent = static_cast<float>(-0.5 * kReach * kReach);
  const auto add_tap = [&](std::size_t from, std::size_t to, std::vector<Tap>& taps) {
    Tap tap{static_cast<int>(from), std::vector<float>(samples)};
    bool any = false;
    for (std::size_t s = 0; s < samples; ++s) {
      const float* positions = position_mm.data() + s * count;
      const float distance = positions[from] - positions[to];
      const float exponent = factor[s] * distance * distance;
      if (exponent < kLeastExponent) continue;
      tap.weights[s] = std::exp(exponent);
      any = true;
    }
    if (any) taps.push_back(std::move(tap));
    return any;
  };
  Taps taps(count);
  parallel_for(static_cast<int>(count), [&](int row) {
    const auto to = static_cast<std::size_t>(row);
    // Distances grow with the number of rows in between, so the search ends at the first row whose
    // weights are all zero.
    std::size_t first = to;
    std::vector<Tap> before;
    while (first-- > 0 && add_tap(first, to, before)) continue;
    std::move(before.rbegin(), before.rend(), std::back_inserter(taps[to]));
    for (std::size_t from = to; from < count && add_tap(from, to, taps[to]); ++from) continue;
  });
  return taps;
}

std::vector<float> GaussianSums::operator()(std::vector<float> values) const {
  if (samples_.size == 1 && lines_.size == 1 && frames_.size == 1) {
    sum_within_frames(values);
    sum_across_frames(values);
    return values;
  }
  std::vector<float> blocks = block_sums(values);
  sum_within_frames(blocks);
  sum_across_frames(blocks);
  interpolate(blocks, values);
  return values;
}

std::vector<float> GaussianSums::block_sums(const std::vector<float>& values) const {
  const auto blocks = static_cast<std::size_t>(samples_.blocks());
  const auto row_size = static_cast<std::size_t>(samples_.count);
  std::vector<float> sums(blocks * static_cast<std::size_t>(lines_.blocks()) *
                          static_cast<std::size_t>(frames_.blocks()));
  std::vector<std::size_t> block_of(row_size);
  for (std::size_t s = 0; s < row_size; ++s)
    block_of[s] = static_cast<std::size_t>(samples_.block_of(static_cast<int>(s)));
  parallel_for(frames_.blocks(), [&](int frame_block) {
    std::vector<float> row(row_size);
    for (int frame = 0; frame < frames_.count; ++frame) {
      if (frames_.block_of(frame) != frame_block) continue;
      for (int line = 0; line < lines_.count; ++line) {
        const float* in = values.data() + (static_cast<std::size_t>(frame) *
                                               static_cast<std::size_t>(lines_.count) +
                                           static_cast<std::size_t>(line)) *
                                              row_size;
        float* out = sums.data() + (static_cast<std::size_t>(frame_block) *
                                        static_cast<std::size_t>(lines_.blocks()) +
                                    static_cast<std::size_t>(lines_.block_of(line))) *
                                       blocks;
        for (std::size_t s = 0; s < row_size; ++s) out[block_of[s]] += in[s];
      }
    }
  });
  return sums;
}

void GaussianSums::sum_within_frames(std::vector<float>& values) const {
  const auto row = static_cast<std::size_t>(samples_.blocks());
  const std::size_t frame_size = row * static_cast<std::size_t>(lines_.blocks());
  const std::size_t reach = kernel_.size() / 2;
  std::vector<std::vector<float>> weights;
  for (const float weight : kernel_) weights.emplace_back(row, weight);
  parallel_for(frames_.blocks(), [&](int frame) {
    const std::size_t start = static_cast<std::size_t>(frame) * frame_size;
    std::vector<float> along(frame_size);
    std::vector<float> padded(row + 2 * reach);
    std::vector<WeightedRow> rows;
    for (std::size_t i = 0; i < kernel_.size(); ++i)
      rows.push_back({weights[i].data(), padded.data() + i});
    for (std::size_t line = 0; line < line_taps_.size(); ++line) {
      std::copy_n(values.data() + start + line * row, row, padded.data() + reach);
      combine_rows(rows.data(), rows.size(), row, along.data() + line * row);
    }
    for (std::size_t line = 0; line < line_taps_.size(); ++line) {
      rows.clear();
      for (const Tap& tap : line_taps_[line])
        rows.push_back(
            {tap.weights.data(), along.data() + static_cast<std::size_t>(tap.row) * row});
      combine_rows(rows.data(), rows.size(), row, values.data() + start + line * row);
    }
  });
}

void GaussianSums::sum_across_frames(std::vector<float>& values) const {
  const auto row = static_cast<std::size_t>(samples_.blocks());
  const std::size_t frame_size = row * static_cast<std::size_t>(lines_.blocks());
  parallel_for(lines_.blocks(), [&](int line) {
    float* const start = values.data() + static_cast<std::size_t>(line) * row;
    std::vector<float> sums(frame_taps_.size() * row);
    std::vector<WeightedRow> rows;
    for (std::size_t frame = 0; frame < frame_taps_.size(); ++frame) {
      rows.clear();
      for (const Tap& tap : frame_taps_[frame])
        rows.push_back(
            {tap.weights.data(), start + static_cast<std::size_t>(tap.row) * frame_size});
      combine_rows(rows.data(), rows.size(), row, sums.data() + frame * row);
    }
    for (std::size_t frame = 0; frame < frame_taps_.size(); ++frame)
      std::copy_n(sums.data() + frame * row, row, start + frame * frame_size);
  });
}

void GaussianSums::interpolate(const std::vector<float>& sums, std::vector<float>& values) const {
  const auto row = static_cast<std::size_t>(samples_.blocks());
  const auto row_size = static_cast<std::size_t>(samples_.count);
  const std::size_t frame_size = row * static_cast<std::size_t>(lines_.blocks());
  std::vector<int> block(row_size);
  std::vector<float> share(row_size);
  for (std::size_t s = 0; s < row_size; ++s)
    samples_.between(static_cast<int>(s), block[s], share[s]);
  parallel_for(frames_.count, [&](int frame) {
    int frame_block = 0;
    float frame_share = 0.0F;
    frames_.between(frame, frame_block, frame_share);
    std::vector<float> between(row + 1);  // one element more, which gets weight 0
    const auto add = [&](int f, int l, float weight) {
      if (weight == 0.0F) return;
      const float* in = sums.data() + static_cast<std::size_t>(f) * frame_size +
                        static_cast<std::size_t>(l) * row;
      for (std::size_t s = 0; s < row; ++s) between[s] += weight * in[s];
    };
    for (int line = 0; line < lines_.count; ++line) {
      int line_block = 0;
      float line_share = 0.0F;
      lines_.between(line, line_block, line_share);
      std::fill(between.begin(), between.end(), 0.0F);
      add(frame_block, line_block, (1.0F - frame_share) * (1.0F - line_share));
      add(frame_block, line_block + 1, (1.0F - frame_share) * line_share);
      add(frame_block + 1, line_block, frame_share * (1.0F - line_share));
      add(frame_block + 1, line_block + 1, frame_share * line_share);
      float* out = values.data() +
                   (static_cast<std::size_t>(frame) * static_cast<std::size_t>(lines_.count) +
                    static_cast<std::size_t>(line)) *
                       row_size;
      for (std::size_t s = 0; s < row_size; ++s) {
        const float* pair = between.data() + block[s];
        out[s] = pair[0] + share[s] * (pair[1] - pair[0]);
      }
    }
  });
}

}  // namespace usct
