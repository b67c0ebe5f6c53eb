#include "volume/axis_filter.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"

namespace usct {
namespace {

/// Float rows of a box of the input: index (i, j, k) of the volume is at
/// values[((k - begin.z) * size.y + (j - begin.y)) * size.x + (i - begin.x)].
struct Box {
  Eigen::Vector3i begin;
  Eigen::Vector3i size;
  std::vector<float> values;

  Box(const Eigen::Vector3i& begin_in, const Eigen::Vector3i& size_in)
      : begin(begin_in),
        size(size_in),
        values(static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
               static_cast<std::size_t>(size.z())) {}

  float* row(int j, int k) {
    return values.data() + (static_cast<std::size_t>(k) * static_cast<std::size_t>(size.y()) +
                            static_cast<std::size_t>(j)) *
                               static_cast<std::size_t>(size.x());
  }
  const float* row(int j, int k) const { return const_cast<Box*>(this)->row(j, k); }
};

/// Input indices along one axis that `count` outputs read, after clamping to [0, size).
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

/// One output row along x from a row of the volume.
template <typename T>
void filter_row(const T* in, int in_size, const AxisFilter& filter, int begin, float* out,
                int count) {
  const int taps = static_cast<int>(filter.weights.size());
  const auto clamped_sum = [&](int o) {
    float sum = 0.0F;
    for (int t = 0; t < taps; ++t)
      sum += filter.weights[static_cast<std::size_t>(t)] *
             static_cast<float>(
                 in[std::clamp(begin + o * filter.stride + filter.first + t, 0, in_size - 1)]);
    return sum;
  };
  // Outputs in [inner, inner_end) read no voxel beyond the edges; there the loop over outputs is
  // the inner one, which the compiler can turn into vector instructions.
  const int reach = begin + filter.first;
  const int inner = std::clamp((-reach + filter.stride - 1) / filter.stride, 0, count);
  const int room = in_size - taps - reach;
  const int inner_end = std::clamp(room < 0 ? 0 : room / filter.stride + 1, inner, count);
  for (int o = 0; o < inner; ++o) out[o] = clamped_sum(o);
  for (int o = inner_end; o < count; ++o) out[o] = clamped_sum(o);
  std::fill(out + inner, out + inner_end, 0.0F);
  for (int t = 0; t < taps; ++t) {
    const float weight = filter.weights[static_cast<std::size_t>(t)];
    const T* from = in + reach + t;
    for (int o = inner; o < inner_end; ++o)
      out[o] += weight * static_cast<float>(from[o * filter.stride]);
  }
}

void add_scaled_row(const float* in, float weight, float* out, int count) {
  for (int i = 0; i < count; ++i) out[i] += weight * in[i];
}

template <typename T>
Box filter_x(const Volume<T>& volume, const AxisFilter& filter, int begin, int count, Range y,
             Range z) {
  Box out({0, y.begin, z.begin}, {count, y.end - y.begin, z.end - z.begin});
  parallel_for(out.size.z(), [&](int k) {
    for (int j = 0; j < out.size.y(); ++j)
      filter_row(&volume.at(0, y.begin + j, z.begin + k), volume.grid.size.x(), filter, begin,
                 out.row(j, k), count);
  });
  return out;
}

/// Along y (axis 1) or z (axis 2), whole rows at a time.
Box filter_rows(const Box& in, int axis, const AxisFilter& filter, int begin, int count,
                int volume_size) {
  Eigen::Vector3i out_begin = in.begin;
  Eigen::Vector3i out_size = in.size;
  out_begin[axis] = 0;
  out_size[axis] = count;
  Box out(out_begin, out_size);
  const int taps = static_cast<int>(filter.weights.size());
  parallel_for(out.size.z(), [&](int k) {
    for (int j = 0; j < out.size.y(); ++j) {
      const int first = begin + (axis == 1 ? j : k) * filter.stride + filter.first;
      for (int t = 0; t < taps; ++t) {
        const int index = std::clamp(first + t, 0, volume_size - 1) - in.begin[axis];
        const float* row = axis == 1 ? in.row(index, k) : in.row(j, index);
        add_scaled_row(row, filter.weights[static_cast<std::size_t>(t)], out.row(j, k),
                       out.size.x());
      }
    }
  });
  return out;
}

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
  const Range y = input_range(filters[1], begin.y(), out_size.y(), size.y());
  const Range z = input_range(filters[2], begin.z(), out_size.z(), size.z());
  const Box along_x = filter_x(volume, filters[0], begin.x(), out_size.x(), y, z);
  const Box along_y = filter_rows(along_x, 1, filters[1], begin.y(), out_size.y(), size.y());
  return filter_rows(along_y, 2, filters[2], begin.z(), out_size.z(), size.z()).values;
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
