#include "ultrasound/gaussian_sums.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "parallel.h"
#include "ultrasound/moving_place.h"
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

/// Calls `body(first, last)` for groups of frames or lines, whose sums share the loading of
/// weights.
template <typename Body>
void for_groups(int count, const Body& body) {
  constexpr int kTogether = 4;
  parallel_for((count + kTogether - 1) / kTogether, [&](int group) {
    body(group * kTogether, std::min(count, (group + 1) * kTogether));
  });
}

}  // namespace

GaussianSums::GaussianSums(const BeamGrid& beams, double sigma_mm) : sigma_mm_(sigma_mm) {
  const int deepest = beams.samples() - 1;
  const auto on_line = [&](int line, double sample) {
    return beams.point(beams.frames / 2, line, sample);
  };
  const int moving_line = moving_place(beams).line;
  const auto on_frame = [&](int frame, double sample) {
    return beams.point(frame, moving_line, sample);
  };
  const auto blocks = [&](int count, const auto& point_at) {
    const auto widest_at = [&](int sample) {
      return widest_step_mm(count, [&](int row) { return point_at(row, sample); });
    };
    return AxisBlocks{count, block_size(std::max(widest_at(0), widest_at(deepest)), sigma_mm)};
  };
  const double spacing_mm = beams.axial.spacing_mm;
  samples_ = {beams.samples(), block_size(spacing_mm, sigma_mm)};
  lines_ = blocks(beams.lines, on_line);
  frames_ = blocks(beams.frames, on_frame);

  row_size_ = (static_cast<std::size_t>(samples_.blocks()) + kRowPart - 1) / kRowPart * kRowPart;
  const double step_mm = spacing_mm * samples_.size;
  const double variance = variance_mm2(sigma_mm, step_mm, samples_.size);
  // Farther away there are no samples, and the reach of a wide window exceeds the range of int.
  const int reach = static_cast<int>(
      std::min(kReach * std::sqrt(variance) / step_mm, static_cast<double>(row_size_)));
  for (int i = -reach; i <= reach; ++i)
    kernel_.push_back(static_cast<float>(std::exp(-0.5 * i * i * step_mm * step_mm / variance)));
  line_taps_ = taps_across(lines_, on_line);
  frame_taps_ = taps_across(frames_, on_frame);
}

template <typename PointAt>
std::vector<GaussianSums::Taps> GaussianSums::taps_across(const AxisBlocks& rows,
                                                          const PointAt& point_at) const {
  const auto count = static_cast<std::size_t>(rows.blocks());
  const auto samples = static_cast<std::size_t>(samples_.blocks());
  std::vector<float> position_mm(count * samples);  // samples fastest
  std::vector<float> factor(samples);               // exponent per squared distance
  parallel_for(samples_.blocks(), [&](int sample_block) {
    const auto s = static_cast<std::size_t>(sample_block);
    const double sample = samples_.middle(sample_block);
    const std::vector<double> path =
        path_mm(rows.count, [&](int row) { return point_at(row, sample); });
    for (std::size_t row = 0; row < count; ++row)
      position_mm[row * samples + s] =
          static_cast<float>(interpolated_at(path, rows.middle(static_cast<int>(row))));
    const double block_mm = path.back() / std::max(1, rows.count - 1) * rows.size;
    factor[s] = static_cast<float>(-0.5 / variance_mm2(sigma_mm_, block_mm, rows.size));
  });
  constexpr auto kLeastExponent = static_cast<float>(-0.5 * kReach * kReach);
  const auto exponent = [&](std::size_t from, std::size_t to, std::size_t s) {
    const float distance = position_mm[from * samples + s] - position_mm[to * samples + s];
    return factor[s] * distance * distance;
  };
  std::vector<Taps> taps(row_size_ / kRowPart);
  parallel_for(static_cast<int>(taps.size()), [&](int part) {
    auto& [ranges, weights] = taps[static_cast<std::size_t>(part)];
    const std::size_t begin = static_cast<std::size_t>(part) * kRowPart;
    const std::size_t end = std::min(samples, begin + kRowPart);
    for (std::size_t to = 0; to < count; ++to) {
      const auto is_within = [&](std::size_t from) {
        for (std::size_t s = begin; s < end; ++s)
          if (!(exponent(from, to, s) < kLeastExponent)) return true;
        return false;
      };
      // Distances grow with the number of rows in between.
      std::size_t first = to;
      while (first > 0 && is_within(first - 1)) --first;
      std::size_t last = to;
      while (last + 1 < count && is_within(last + 1)) ++last;
      ranges.push_back({first, last + 1 - first, weights.size()});
      for (std::size_t from = first; from <= last; ++from)
        for (std::size_t s = begin; s < begin + kRowPart; ++s) {
          const bool outside = s >= end || exponent(from, to, s) < kLeastExponent;
          weights.push_back(outside ? 0.0F : std::exp(exponent(from, to, s)));
        }
    }
  });
  return taps;
}

/// Sums rows of tables part by part, since one part of the rows within the window fits into the
/// smallest cache.
void GaussianSums::sum_across(const std::vector<Taps>& taps, std::size_t tables,
                              TableRows<const float> in, TableRows<float> out) {
  for (std::size_t part = 0; part < taps.size(); ++part)
    combine_tables(taps[part].ranges, taps[part].weights.data(), part * kRowPart, tables, in, out);
}

/// Rows of blocks along samples, for lines x frames x arrays: the rows of a line at all frames are
/// near each other.
class GaussianSums::Table {
 public:
  Table(const GaussianSums& sums, std::size_t arrays_summed)
      : arrays(arrays_summed),
        row_size_(sums.row_size_),
        frames_(static_cast<std::size_t>(sums.frames_.blocks())),
        values_(static_cast<std::size_t>(sums.lines_.blocks()) * frames_ * arrays * row_size_) {}

  std::size_t frame_stride() const { return arrays * row_size_; }
  std::size_t line_stride() const { return frames_ * frame_stride(); }
  float* row(int frame, int line, std::size_t array) {
    return values_.data() + place(frame, line, array);
  }
  const float* row(int frame, int line, std::size_t array) const {
    return values_.data() + place(frame, line, array);
  }

  std::size_t arrays;

 private:
  std::size_t place(int frame, int line, std::size_t array) const {
    return static_cast<std::size_t>(line) * line_stride() +
           static_cast<std::size_t>(frame) * frame_stride() + array * row_size_;
  }

  std::size_t row_size_;
  std::size_t frames_;
  LargeVector<float> values_;
};

void GaussianSums::operator()(std::size_t arrays, const Fill& fill, const Use& use) const {
  Table sums = sums_within_frames(arrays, fill);
  if (samples_.size == 1 && lines_.size == 1 && frames_.size == 1) {
    sum_across_frames(sums, use);
    return;
  }
  sum_across_frames(sums, [&](int frame, int line, const float* const* rows) {
    for (std::size_t array = 0; array < arrays; ++array)
      std::copy_n(rows[array], row_size_, sums.row(frame, line, array));
  });
  interpolate(sums, use);
}

std::vector<float> GaussianSums::operator()(const std::vector<float>& values) const {
  const auto samples = static_cast<std::size_t>(samples_.count);
  const auto start = [&](int frame, int line) {
    return (static_cast<std::size_t>(frame) * static_cast<std::size_t>(lines_.count) +
            static_cast<std::size_t>(line)) *
           samples;
  };
  std::vector<float> sums(values.size());
  const auto fill = [&](int frame, int line, float* const* rows) {
    std::copy_n(values.data() + start(frame, line), samples, rows[0]);
  };
  (*this)(1, fill, [&](int frame, int line, const float* const* rows) {
    std::copy_n(rows[0], samples, sums.data() + start(frame, line));
  });
  return sums;
}

GaussianSums::Table GaussianSums::sums_within_frames(std::size_t arrays, const Fill& fill) const {
  Table sums(*this, arrays);
  const std::size_t table_size = row_size_ * static_cast<std::size_t>(lines_.blocks());
  for_groups(frames_.blocks(), [&](int first, int last) {
    LargeVector<float> along(static_cast<std::size_t>(last - first) * arrays * table_size);
    std::vector<float*> tables;
    for (std::size_t i = 0; i < along.size(); i += table_size) tables.push_back(along.data() + i);
    for (int frame = first; frame < last; ++frame)
      sum_along_samples(frame, fill,
                        tables.data() + static_cast<std::size_t>(frame - first) * arrays, arrays);
    std::vector<float*> out;
    for (int frame = first; frame < last; ++frame)
      for (std::size_t array = 0; array < arrays; ++array) out.push_back(sums.row(frame, 0, array));
    sum_across(line_taps_, tables.size(), {tables.data(), row_size_},
               {out.data(), sums.line_stride()});
  });
  return sums;
}

void GaussianSums::sum_along_samples(int frame_block, const Fill& fill, float* const* tables,
                                     std::size_t arrays) const {
  const std::size_t reach = kernel_.size() / 2;
  const std::size_t padded_size = row_size_ + 2 * reach;
  const auto samples = static_cast<std::size_t>(samples_.count);
  std::vector<float> padded(arrays * padded_size);
  std::vector<float> values(arrays * samples);
  std::vector<float*> rows;
  for (std::size_t array = 0; array < arrays; ++array)
    rows.push_back(values.data() + array * samples);
  std::vector<const float*> shifted(kernel_.size());
  for (int line_block = 0; line_block < lines_.blocks(); ++line_block) {
    std::fill(padded.begin(), padded.end(), 0.0F);
    for (int frame = frames_.first(frame_block); frame < frames_.first(frame_block + 1); ++frame)
      for (int line = lines_.first(line_block); line < lines_.first(line_block + 1); ++line) {
        fill(frame, line, rows.data());
        for (std::size_t array = 0; array < arrays; ++array)
          samples_.add(rows[array], padded.data() + array * padded_size + reach);
      }
    for (std::size_t array = 0; array < arrays; ++array) {
      for (std::size_t i = 0; i < shifted.size(); ++i)
        shifted[i] = padded.data() + array * padded_size + i;
      combine_rows(shifted.data(), kernel_.data(), shifted.size(), row_size_,
                   tables[array] + static_cast<std::size_t>(line_block) * row_size_);
    }
  }
}

void GaussianSums::sum_across_frames(const Table& table, const Use& use) const {
  const auto frames = static_cast<std::size_t>(frames_.blocks());
  for_groups(lines_.blocks(), [&](int first, int last) {
    const std::size_t tables = static_cast<std::size_t>(last - first) * table.arrays;
    LargeVector<float> sums(frames * tables * row_size_);  // frames x lines x arrays
    std::vector<const float*> in;
    std::vector<float*> out;
    for (int line = first; line < last; ++line)
      for (std::size_t array = 0; array < table.arrays; ++array) {
        in.push_back(table.row(0, line, array));
        out.push_back(sums.data() + out.size() * row_size_);
      }
    sum_across(frame_taps_, tables, {in.data(), table.frame_stride()},
               {out.data(), tables * row_size_});
    std::vector<const float*> rows(table.arrays);
    const float* row = sums.data();
    for (int frame = 0; frame < frames_.blocks(); ++frame)
      for (int line = first; line < last; ++line) {
        for (const float*& array : rows) array = std::exchange(row, row + row_size_);
        use(frame, line, rows.data());
      }
  });
}

void GaussianSums::interpolate(const Table& table, const Use& use) const {
  const auto blocks = static_cast<std::size_t>(samples_.blocks());
  const auto samples = static_cast<std::size_t>(samples_.count);
  std::vector<int> block(samples);
  std::vector<float> share(samples);
  for (std::size_t s = 0; s < samples; ++s)
    samples_.between(static_cast<int>(s), block[s], share[s]);
  parallel_for(frames_.count, [&](int frame) {
    int frame_block = 0;
    float frame_share = 0.0F;
    frames_.between(frame, frame_block, frame_share);
    std::vector<float> between(blocks + 1);  // one element more, which gets weight 0
    std::vector<float> values(table.arrays * samples);
    std::vector<const float*> rows(table.arrays);
    const auto add = [&](int f, int l, std::size_t array, float weight) {
      if (weight == 0.0F) return;
      const float* in = table.row(f, l, array);
      for (std::size_t s = 0; s < blocks; ++s) between[s] += weight * in[s];
    };
    for (int line = 0; line < lines_.count; ++line) {
      int line_block = 0;
      float line_share = 0.0F;
      lines_.between(line, line_block, line_share);
      for (std::size_t array = 0; array < table.arrays; ++array) {
        std::fill(between.begin(), between.end(), 0.0F);
        add(frame_block, line_block, array, (1.0F - frame_share) * (1.0F - line_share));
        add(frame_block, line_block + 1, array, (1.0F - frame_share) * line_share);
        add(frame_block + 1, line_block, array, frame_share * (1.0F - line_share));
        add(frame_block + 1, line_block + 1, array, frame_share * line_share);
        float* out = values.data() + array * samples;
        for (std::size_t s = 0; s < samples; ++s) {
          const float* pair = between.data() + block[s];
          out[s] = pair[0] + share[s] * (pair[1] - pair[0]);
        }
        rows[array] = out;
      }
      use(frame, line, rows.data());
    }
  });
}

}  // namespace usct
