#include "us_ct_registration/volume/operations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>

#include "parallel.h"
#include "us_ct_registration/error.h"
#include "volume/axis_filter.h"

namespace usct {
namespace {

template <typename T>
T to_voxel(float value) {
  if constexpr (std::is_floating_point_v<T>) {
    return value;
  } else {
    using Limits = std::numeric_limits<T>;
    return static_cast<T>(std::clamp(std::nearbyint(value), static_cast<float>(Limits::lowest()),
                                     static_cast<float>(Limits::max())));
  }
}

void require_within(const Region& region, const Grid& grid) {
  const Eigen::Vector3i end = region.begin + region.size;
  if ((region.size.array() < 1).any() || (region.begin.array() < 0).any() ||
      (end.array() > grid.size.array()).any()) {
    const auto text = [](const Eigen::Vector3i& v) {
      return std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z());
    };
    throw InputError("region", "from " + text(region.begin) + " with size " + text(region.size) +
                                   ", must not be empty and must lie in the volume of size " +
                                   text(grid.size));
  }
}

}  // namespace

Region whole(const Grid& grid) { return {Eigen::Vector3i::Zero(), grid.size}; }

Grid region_grid(const Grid& grid, const Region& region) {
  require_within(region, grid);
  Grid result = grid;
  result.size = region.size;
  result.origin_mm = grid.physical_from_index(region.begin.cast<double>());
  return result;
}

Grid shrunk_grid(const Grid& grid, const Eigen::Vector3i& factors, const Region& region) {
  require_within(region, grid);
  for (int axis = 0; axis < 3; ++axis)
    if (factors[axis] < 1 || factors[axis] > region.size[axis])
      throw InputError("shrink", "factor is " + std::to_string(factors[axis]) +
                                     ", must be from 1 to " + std::to_string(region.size[axis]) +
                                     ", the size of the region along that axis");
  Grid result;
  result.direction = grid.direction;
  result.size = region.size.cwiseQuotient(factors);
  result.spacing_mm = grid.spacing_mm.cwiseProduct(factors.cast<double>());
  // Index of the centre of the first block.
  const Eigen::Vector3d centre = 0.5 * (factors.cast<double>() - Eigen::Vector3d::Ones());
  result.origin_mm = grid.physical_from_index(region.begin.cast<double>() + centre);
  return result;
}

Region region_around(const Grid& grid, const std::vector<Eigen::Vector3d>& points_mm,
                     double margin_mm) {
  if (points_mm.empty()) return {};
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  for (const Eigen::Vector3d& p_mm : points_mm) {
    const Eigen::Vector3d index = grid.index_from_physical(p_mm);
    low = low.cwiseMin(index);
    high = high.cwiseMax(index);
  }
  const Eigen::Vector3d margin = margin_mm * grid.spacing_mm.cwiseInverse();
  // Indices are clipped before the cast, since those of far points exceed the range of int.
  const Eigen::Vector3d end = grid.size.cast<double>();
  const Eigen::Vector3i first =
      (low - margin).array().floor().max(0.0).min(end.array()).cast<int>();
  const Eigen::Vector3i last =
      ((high + margin).array().ceil() + 1.0).max(0.0).min(end.array()).cast<int>();
  if (((last - first).array() < 1).any()) return {};
  return {first, last - first};
}

template <typename T>
Volume<T> crop(const Volume<T>& volume, const Region& region) {
  Volume<T> result(region_grid(volume.grid, region));
  parallel_for(region.size.z(), [&](int k) {
    for (int j = 0; j < region.size.y(); ++j) {
      const T* row = &volume.at(region.begin.x(), region.begin.y() + j, region.begin.z() + k);
      std::copy_n(row, region.size.x(), &result.at(0, j, k));
    }
  });
  return result;
}

template <typename T>
Volume<T> resample(const Volume<T>& source, const Grid& target,
                   const Eigen::Isometry3d& T_source_target, Interpolation interpolation,
                   Outside outside, const Progress& progress) {
  target.validate("resampling grid");
  if (!T_source_target.matrix().allFinite())
    throw InputError("resampling", "T_source_target holds a number that is not finite");
  const Eigen::Affine3d T_sourceindex_targetindex =
      source.grid.T_index_physical() * T_source_target * target.T_physical_index();
  Volume<T> result(target);
  parallel_for(
      target.size.z(),
      [&](int k) {
        for (int j = 0; j < target.size.y(); ++j) {
          const Eigen::Vector3d start = T_sourceindex_targetindex * Eigen::Vector3d(0, j, k);
          const Eigen::Vector3d step = T_sourceindex_targetindex.linear().col(0);
          T* row = &result.at(0, j, k);
          for (int i = 0; i < target.size.x(); ++i)
            row[i] = to_voxel<T>(sample_at_index(source, start + i * step, interpolation, outside));
        }
      },
      progress);
  return result;
}

template <typename T>
Volume<float> smooth_gaussian(const Volume<T>& volume, const Eigen::Vector3d& sigma_mm,
                              const Region& region) {
  require_within(region, volume.grid);
  std::array<AxisFilter, 3> filters;
  for (int axis = 0; axis < 3; ++axis) {
    const double sigma = sigma_mm[axis];
    if (!std::isfinite(sigma) || sigma < 0.0)
      throw InputError("smoothing", "sigma is " + std::to_string(sigma) + " mm, must be >= 0");
    filters[static_cast<std::size_t>(axis)] =
        gaussian_filter(sigma / volume.grid.spacing_mm[axis], 1);
  }
  Volume<float> result;
  result.grid = region_grid(volume.grid, region);
  result.voxels = apply_separable(volume, filters, region.begin, region.size);
  return result;
}

template <typename T>
Volume<float> shrink(const Volume<T>& volume, const Eigen::Vector3i& factors,
                     const Region& region) {
  Volume<float> result;
  result.grid = shrunk_grid(volume.grid, factors, region);
  std::array<AxisFilter, 3> filters;
  for (int axis = 0; axis < 3; ++axis)
    filters[static_cast<std::size_t>(axis)] =
        gaussian_filter(factors[axis] == 1 ? 0.0 : 0.5 * factors[axis], factors[axis]);
  result.voxels = apply_separable(volume, filters, region.begin, result.grid.size);
  return result;
}

template <typename T>
std::vector<Volume<float>> pyramid(const Volume<T>& volume,
                                   const std::vector<Eigen::Vector3i>& factors,
                                   const Region& region) {
  std::vector<Volume<float>> levels;
  levels.reserve(factors.size());
  for (const Eigen::Vector3i& f : factors) levels.push_back(shrink(volume, f, region));
  return levels;
}

template <typename T>
Volume<T> reorient_to_axes(const Volume<T>& volume) {
  // Find the permutation of the axes that agrees best with x, y, z.
  std::array<int, 3> order{0, 1, 2};
  std::array<int, 3> best = order;
  double best_agreement = -1.0;
  do {
    double agreement = 0.0;
    for (int a = 0; a < 3; ++a)
      agreement += std::abs(volume.grid.direction(a, order[static_cast<std::size_t>(a)]));
    if (agreement > best_agreement) {
      best_agreement = agreement;
      best = order;
    }
  } while (std::next_permutation(order.begin(), order.end()));

  Grid grid;
  Eigen::Vector3i origin_index;
  Eigen::Matrix3i step = Eigen::Matrix3i::Zero();  // old index step of each new axis
  for (int a = 0; a < 3; ++a) {
    const int old = best[static_cast<std::size_t>(a)];
    const bool flipped = volume.grid.direction(a, old) < 0.0;
    grid.size[a] = volume.grid.size[old];
    grid.spacing_mm[a] = volume.grid.spacing_mm[old];
    grid.direction.col(a) = (flipped ? -1.0 : 1.0) * volume.grid.direction.col(old);
    origin_index[old] = flipped ? volume.grid.size[old] - 1 : 0;
    step(old, a) = flipped ? -1 : 1;
  }
  grid.origin_mm = volume.grid.physical_from_index(origin_index.cast<double>());
  Volume<T> result(grid);
  parallel_for(grid.size.z(), [&](int k) {
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const Eigen::Vector3i old = origin_index + step * Eigen::Vector3i(i, j, k);
        result.at(i, j, k) = volume.at(old.x(), old.y(), old.z());
      }
  });
  return result;
}

#define USCT_INSTANTIATE(T)                                                                        \
  template Volume<T> crop(const Volume<T>&, const Region&);                                        \
  template Volume<T> resample(const Volume<T>&, const Grid&, const Eigen::Isometry3d&,             \
                              Interpolation, Outside, const Progress&);                            \
  template Volume<float> smooth_gaussian(const Volume<T>&, const Eigen::Vector3d&, const Region&); \
  template Volume<float> shrink(const Volume<T>&, const Eigen::Vector3i&, const Region&);          \
  template std::vector<Volume<float>> pyramid(const Volume<T>&,                                    \
                                              const std::vector<Eigen::Vector3i>&, const Region&); \
  template Volume<T> reorient_to_axes(const Volume<T>&);
USCT_INSTANTIATE(std::uint8_t)
USCT_INSTANTIATE(std::int16_t)
USCT_INSTANTIATE(std::uint16_t)
USCT_INSTANTIATE(float)
#undef USCT_INSTANTIATE

}  // namespace usct
