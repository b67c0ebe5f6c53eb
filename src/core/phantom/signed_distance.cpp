#include "phantom/signed_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "parallel.h"
#include "us_ct_registration/volume/operations.h"

namespace usct::phantom {
namespace {

constexpr float kUnreached = 1e12F;

/// Lower envelope of parabolas with apices (i * spacing, f[i]), evaluated at every i.
void transform_row(std::vector<float>& f, double spacing) {
  const int n = static_cast<int>(f.size());
  std::vector<int> apex(static_cast<std::size_t>(n));
  std::vector<double> from(static_cast<std::size_t>(n) + 1);
  const auto height = [&](int i) { return static_cast<double>(f[static_cast<std::size_t>(i)]); };
  const auto meet = [&](int q, int v) {
    const double xq = q * spacing;
    const double xv = v * spacing;
    return ((height(q) + xq * xq) - (height(v) + xv * xv)) / (2.0 * (xq - xv));
  };
  int last = 0;
  apex[0] = 0;
  from[0] = -std::numeric_limits<double>::infinity();
  for (int q = 1; q < n; ++q) {
    double s = meet(q, apex[static_cast<std::size_t>(last)]);
    while (s <= from[static_cast<std::size_t>(last)]) {
      --last;
      s = meet(q, apex[static_cast<std::size_t>(last)]);
    }
    ++last;
    apex[static_cast<std::size_t>(last)] = q;
    from[static_cast<std::size_t>(last)] = s;
  }
  std::vector<float> result(f.size());
  int k = 0;
  for (int q = 0; q < n; ++q) {
    while (k < last && from[static_cast<std::size_t>(k) + 1] < q * spacing) ++k;
    const int v = apex[static_cast<std::size_t>(k)];
    const double d = (q - v) * spacing;
    result[static_cast<std::size_t>(q)] = static_cast<float>(d * d + height(v));
  }
  f = std::move(result);
}

/// Squared distance to the nearest voxel whose mask is `wanted`.
Volume<float> squared_distance(const MaskVolume& mask, bool wanted) {
  Volume<float> d(mask.grid);
  for (std::size_t i = 0; i < d.voxels.size(); ++i)
    d.voxels[i] = (mask.voxels[i] != 0) == wanted ? 0.0F : kUnreached;
  const Eigen::Vector3i& size = mask.grid.size;
  for (int axis = 0; axis < 3; ++axis) {
    const int a = axis == 0 ? 1 : 0;
    const int b = axis == 2 ? 1 : 2;
    parallel_for(size[b], [&](int ib) {
      std::vector<float> row(static_cast<std::size_t>(size[axis]));
      Eigen::Vector3i at;
      at[b] = ib;
      for (at[a] = 0; at[a] < size[a]; ++at[a]) {
        const auto voxel = [&](int i) -> float& {
          at[axis] = i;
          return d.at(at.x(), at.y(), at.z());
        };
        for (int i = 0; i < size[axis]; ++i) row[static_cast<std::size_t>(i)] = voxel(i);
        transform_row(row, mask.grid.spacing_mm[axis]);
        for (int i = 0; i < size[axis]; ++i) voxel(i) = row[static_cast<std::size_t>(i)];
      }
    });
  }
  return d;
}

}  // namespace

Volume<float> signed_distance(const MaskVolume& mask) {
  Volume<float> outside = squared_distance(mask, true);
  const Volume<float> inside = squared_distance(mask, false);
  const auto half = static_cast<float>(0.5 * mask.grid.spacing_mm.minCoeff());
  for (std::size_t i = 0; i < outside.voxels.size(); ++i)
    outside.voxels[i] = mask.voxels[i] != 0 ? half - std::sqrt(inside.voxels[i])
                                            : std::sqrt(outside.voxels[i]) - half;
  return outside;
}

Volume<float> smooth_signed_distance(const MaskVolume& mask, double sigma_mm) {
  return smooth_gaussian(signed_distance(mask), Eigen::Vector3d::Constant(sigma_mm),
                         whole(mask.grid));
}

}  // namespace usct::phantom
