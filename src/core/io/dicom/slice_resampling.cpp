#include <algorithm>
#include <cmath>

#include "io/dicom/slice_stack.h"
#include "io/format.h"
#include "parallel.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

constexpr int kMostSlices = 8192;
/// Columns or rows that sideways shifts may add to those of a slice.
constexpr int kMostAdded = 8192;

/// Interpolates one slice at continuous indices. Returns false outside the slice.
bool bilinear(const std::int16_t* slice, const Eigen::Vector2i& size, double x, double y,
              double* value) {
  constexpr double kRounding = 1e-6;
  if (!(x >= -kRounding && y >= -kRounding && x <= size.x() - 1 + kRounding &&
        y <= size.y() - 1 + kRounding))
    return false;
  const int x0 = std::clamp(static_cast<int>(x), 0, std::max(0, size.x() - 2));
  const int y0 = std::clamp(static_cast<int>(y), 0, std::max(0, size.y() - 2));
  const int right = size.x() > 1 ? 1 : 0;
  const std::ptrdiff_t below = size.y() > 1 ? size.x() : 0;
  const std::int16_t* at = slice + static_cast<std::ptrdiff_t>(y0) * size.x() + x0;
  const double fx = std::clamp(x - x0, 0.0, 1.0);
  const double fy = std::clamp(y - y0, 0.0, 1.0);
  *value = (1.0 - fy) * ((1.0 - fx) * at[0] + fx * at[right]) +
           fy * ((1.0 - fx) * at[below] + fx * at[below + right]);
  return true;
}

}  // namespace

Grid resampled_grid(const std::string& source, const std::vector<SlicePose>& slices,
                    const SliceStack& stack) {
  constexpr double kRounding = 1e-3;  // shifts below this, in voxels, do not enlarge the grid
  const SlicePose& first = slices[static_cast<std::size_t>(stack.order.front())];
  const double least_mm = stack.least_spacing_mm;
  // The steps from the first slice to the last must be a whole number, so that they may be a little
  // shorter than the least spacing.
  const double steps = std::ceil(stack.depth_mm.back() / least_mm - 0.1);
  if (steps + 1.0 > kMostSlices)
    throw InputError(source, "resampling " + format(stack.depth_mm.back()) +
                                 " mm at the least slice spacing of " + format(least_mm) +
                                 " mm needs " + format(steps + 1.0) +
                                 " slices, must be <= " + std::to_string(kMostSlices));
  Eigen::Vector2d low = stack.shift_mm.front();
  Eigen::Vector2d high = low;
  for (const Eigen::Vector2d& shift : stack.shift_mm) {
    low = low.cwiseMin(shift);
    high = high.cwiseMax(shift);
  }
  const Eigen::Array2d begin = (low.cwiseQuotient(first.spacing_mm).array() + kRounding).floor();
  const Eigen::Array2d end = (high.cwiseQuotient(first.spacing_mm).array() - kRounding).ceil();
  const double added = (end - begin).maxCoeff();
  if (!(added <= kMostAdded))
    throw InputError(source, "resampling slices that lie up to " + format((high - low).maxCoeff()) +
                                 " mm beside each other needs " + format(added) +
                                 " more columns or rows than a slice has, must be <= " +
                                 std::to_string(kMostAdded));
  Grid grid;
  grid.size.head<2>() = first.size + (end - begin).matrix().cast<int>();
  grid.size.z() = static_cast<int>(steps) + 1;
  grid.spacing_mm = {first.spacing_mm.x(), first.spacing_mm.y(), stack.depth_mm.back() / steps};
  grid.direction << first.axes, stack.normal;
  grid.origin_mm = first.position_mm + first.axes * begin.matrix().cwiseProduct(first.spacing_mm);
  return grid;
}

CtVolume resample_stack(const std::string& source, const std::vector<SlicePose>& slices,
                        const SliceStack& stack, const std::vector<std::int16_t>& voxels) {
  CtVolume volume(resampled_grid(source, slices, stack), kAirHu);
  const Grid& grid = volume.grid;
  const SlicePose& first = slices[static_cast<std::size_t>(stack.order.front())];
  const std::size_t slice_voxels = static_cast<std::size_t>(first.size.prod());
  const Eigen::Vector2d begin_mm = first.axes.transpose() * (grid.origin_mm - first.position_mm);

  parallel_for(grid.size.z(), [&](int k) {
    const double depth = std::min(k * grid.spacing_mm.z(), stack.depth_mm.back());
    const auto above =
        std::upper_bound(stack.depth_mm.begin() + 1, stack.depth_mm.end() - 1, depth);
    const auto b = static_cast<std::size_t>(above - stack.depth_mm.begin());
    const std::size_t a = b - 1;
    double weight = (depth - stack.depth_mm[a]) / (stack.depth_mm[b] - stack.depth_mm[a]);
    // A position on one slice needs no neighbour, which may extend less far sideways.
    constexpr double kOnASlice = 1e-6;
    if (weight < kOnASlice) weight = 0.0;
    if (weight > 1.0 - kOnASlice) weight = 1.0;

    const auto index_in = [&](std::size_t slice, int i, int j) -> Eigen::Vector2d {
      return (begin_mm - stack.shift_mm[slice]).cwiseQuotient(first.spacing_mm) +
             Eigen::Vector2d(i, j);
    };
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        double value_a = 0.0;
        double value_b = 0.0;
        const Eigen::Vector2d in_a = index_in(a, i, j);
        const Eigen::Vector2d in_b = index_in(b, i, j);
        if (weight < 1.0 &&
            !bilinear(&voxels[a * slice_voxels], first.size, in_a.x(), in_a.y(), &value_a))
          continue;
        if (weight > 0.0 &&
            !bilinear(&voxels[b * slice_voxels], first.size, in_b.x(), in_b.y(), &value_b))
          continue;
        volume.at(i, j, k) =
            static_cast<std::int16_t>(std::lround((1.0 - weight) * value_a + weight * value_b));
      }
  });
  return volume;
}

}  // namespace usct::io
