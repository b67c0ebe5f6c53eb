#include "volume/axis_filter.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "volume/combine_rows.h"

namespace usct {
namespace {

/// The range of input indices, clamped to [0, size), that `count` outputs read along one axis.
struct Range {
  int begin;
  int end;
};

Range input_range(const AxisFilter& filter, int begin, int count, int size) {
  const int taps = static_cast<int>(filter.weights.size());
  const int first = begin + filter.first;
  const int last = begin + (count - 1) * filter.stride + filter.first + taps - 1;
  return {std::clamp(first, 0, size - 1), std::clamp(last, 0, size - 1) + 1};
}

/// The input index that tap `t` of output `o` reads, clamped to [0, size).
int source(const AxisFilter& filter, int begin, int o, std::size_t t, int size) {
  return std::clamp(begin + o * filter.stride + filter.first + static_cast<int>(t), 0, size - 1);
}

/// Filters one row of the volume along x. `row` holds the voxels from index `row_begin` on; the
/// result has `count` values.
class RowFilter {
 public:
  RowFilter(const AxisFilter& filter, int begin, int count, int row_begin, int row_end)
      : filter_(filter),
        first_(begin + filter.first),
        count_(static_cast<std::size_t>(count)),
        row_begin_(row_begin),
        last_(row_end - 1),
        stride_(static_cast<std::size_t>(filter.stride)) {
    const std::size_t taps = filter.weights.size();
    // The inputs are sorted by their index modulo the stride, so that each tap reads contiguous
    // memory.
    const std::size_t per_place = count_ + (taps - 1) / stride_;
    values_.resize(per_place * stride_);
    for (std::size_t t = 0; t < taps; ++t)
      rows_.push_back(values_.data() + t % stride_ * per_place + t / stride_);
  }

  void operator()(const float* row, float* out) {
    float* place = values_.data();
    const std::size_t per_place = values_.size() / stride_;
    for (std::size_t p = 0; p < stride_; ++p, place += per_place)
      for (std::size_t i = 0; i < per_place; ++i)
        place[i] =
            row[std::min(std::max(first_ + static_cast<int>(i * stride_ + p), row_begin_), last_) -
                row_begin_];
    combine_rows(rows_.data(), filter_.weights.data(), rows_.size(), count_, out);
  }

 private:
  const AxisFilter& filter_;
  int first_;
  std::size_t count_;
  int row_begin_, last_;
  std::size_t stride_;
  std::vector<float> values_;
  std::vector<const float*> rows_;
};

}  // namespace

AxisFilter gaussian_filter(double sigma, int stride) {
  AxisFilter filter;
  filter.stride = stride;
  if (sigma <= 0.0) return filter;
  const double centre = 0.5 * (stride - 1);
  const double reach = 3.0 * sigma;
  const int first = static_cast<int>(std::ceil(centre - reach));
  const int last = static_cast<int>(std::floor(centre + reach));
  filter.first = first;
  filter.weights.clear();
  double sum = 0.0;
  for (int i = first; i <= last; ++i) sum += std::exp(-0.5 * std::pow((i - centre) / sigma, 2));
  for (int i = first; i <= last; ++i)
    filter.weights.push_back(
        static_cast<float>(std::exp(-0.5 * std::pow((i - centre) / sigma, 2)) / sum));
  return filter;
}

template <typename T>
std::vector<float> apply_separable(const Volume<T>& volume,
                                   const std::array<AxisFilter, 3>& filters,
                                   const Eigen::Vector3i& begin, const Eigen::Vector3i& out_size) {
  const Eigen::Vector3i& size = volume.grid.size;
  const Range x = input_range(filters[0], begin.x(), out_size.x(), size.x());
  const Range y = input_range(filters[1], begin.y(), out_size.y(), size.y());
  const auto row_size = static_cast<std::size_t>(x.end - x.begin);
  const auto out_row_size = static_cast<std::size_t>(out_size.x());
  const auto out_rows = static_cast<std::size_t>(out_size.y());
  std::vector<float> result(out_row_size * out_rows * static_cast<std::size_t>(out_size.z()));
  // Each output slice is made by filtering along z first. One slice at a time then stays in the
  // cache, and decimation along z reduces the data before the filters along y and x run.
  const auto filter_slice = [&](int k, std::vector<float>& slice, std::vector<float>& row,
                                RowFilter& along_x) {
    std::vector<const T*> voxels(filters[2].weights.size());
    for (int j = y.begin; j < y.end; ++j) {
      for (std::size_t t = 0; t < voxels.size(); ++t)
        voxels[t] = &volume.at(x.begin, j, source(filters[2], begin.z(), k, t, size.z()));
      combine_rows(voxels.data(), filters[2].weights.data(), voxels.size(), row_size,
                   slice.data() + static_cast<std::size_t>(j - y.begin) * row_size);
    }
    std::vector<const float*> rows(filters[1].weights.size());
    for (int j = 0; j < out_size.y(); ++j) {
      for (std::size_t t = 0; t < rows.size(); ++t)
        rows[t] = slice.data() + static_cast<std::size_t>(
                                     source(filters[1], begin.y(), j, t, size.y()) - y.begin) *
                                     row_size;
      combine_rows(rows.data(), filters[1].weights.data(), rows.size(), row_size, row.data());
      along_x(row.data(), result.data() + (static_cast<std::size_t>(k) * out_rows +
                                           static_cast<std::size_t>(j)) *
                                              out_row_size);
    }
  };
  constexpr int kAtOnce = 4;  // slices that one task filters with the same buffers
  parallel_for((out_size.z() + kAtOnce - 1) / kAtOnce, [&](int part) {
    std::vector<float> slice(row_size * static_cast<std::size_t>(y.end - y.begin));
    std::vector<float> row(row_size);
    RowFilter along_x(filters[0], begin.x(), out_size.x(), x.begin, x.end);
    for (int k = part * kAtOnce; k < std::min(out_size.z(), (part + 1) * kAtOnce); ++k)
      filter_slice(k, slice, row, along_x);
  });
  return result;
}

#define USCT_INSTANTIATE(T)                                                                       \
  template std::vector<float> apply_separable(const Volume<T>&, const std::array<AxisFilter, 3>&, \
                                              const Eigen::Vector3i&, const Eigen::Vector3i&);
USCT_INSTANTIATE(std::uint8_t)
USCT_INSTANTIATE(std::int16_t)
USCT_INSTANTIATE(std::uint16_t)
USCT_INSTANTIATE(float)
#undef USCT_INSTANTIATE

}  // namespace usct
