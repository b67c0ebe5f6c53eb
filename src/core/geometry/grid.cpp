#include "us_ct_registration/geometry/grid.h"

#include <cmath>
#include <limits>
#include <sstream>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr double kOrthonormalTolerance = 1e-4;
constexpr double kSameGridTolerance = 1e-6;

template <typename Vector>
std::string text(const Vector& v) {
  std::ostringstream out;
  out << v.transpose();
  return out.str();
}

}  // namespace

Eigen::Affine3d Grid::T_physical_index() const {
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  T.linear() = direction * spacing_mm.asDiagonal();
  T.translation() = origin_mm;
  return T;
}

Eigen::Affine3d Grid::T_index_physical() const {
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  T.linear() = spacing_mm.cwiseInverse().asDiagonal() * direction.transpose();
  T.translation() = -(T.linear() * origin_mm);
  return T;
}

void Grid::validate(const std::string& source) const {
  if ((size.array() < 1).any())
    throw InputError(source, "size is " + text(size) + ", must be >= 1 along each axis");
  const double count = size.cast<double>().prod();
  if (count > static_cast<double>(std::numeric_limits<std::ptrdiff_t>::max() / 8))
    throw InputError(source, "size is " + text(size) + ", more voxels than memory can address");
  if (!spacing_mm.allFinite() || (spacing_mm.array() <= 0.0).any())
    throw InputError(source, "spacing is " + text(spacing_mm) + " mm, must be finite and > 0");
  if (!origin_mm.allFinite())
    throw InputError(source, "origin is " + text(origin_mm) + " mm, must be finite");
  const Eigen::Matrix3d gram = direction.transpose() * direction;
  if (!direction.allFinite() ||
      (gram - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > kOrthonormalTolerance)
    throw InputError(source, "direction columns are (" + text(direction.col(0)) + "), (" +
                                 text(direction.col(1)) + "), (" + text(direction.col(2)) +
                                 "), must be orthonormal within 1e-4");
}

bool same_grid(const Grid& a, const Grid& b) {
  return a.size == b.size &&
         (a.spacing_mm - b.spacing_mm).cwiseAbs().maxCoeff() < kSameGridTolerance &&
         (a.origin_mm - b.origin_mm).cwiseAbs().maxCoeff() < kSameGridTolerance &&
         (a.direction - b.direction).cwiseAbs().maxCoeff() < kSameGridTolerance;
}

Grid grid_around_box(const Eigen::Vector3d& min_mm, const Eigen::Vector3d& max_mm,
                     double spacing_mm) {
  if (!(spacing_mm > 0.0) || !std::isfinite(spacing_mm))
    throw InputError("grid", "spacing is " + std::to_string(spacing_mm) + " mm, must be > 0");
  const Eigen::Vector3d extent = max_mm - min_mm;
  if (!extent.allFinite() || (extent.array() < 0.0).any())
    throw InputError("grid", "box from " + text(min_mm) + " to " + text(max_mm) +
                                 " mm, must be finite and not inverted");
  const Eigen::Vector3d steps = (extent / spacing_mm).array().ceil();
  if (steps.maxCoeff() > 1e5)
    throw InputError("grid", "box of " + text(extent) + " mm at " + std::to_string(spacing_mm) +
                                 " mm needs more than 100000 voxels along an axis");
  if (const double voxels = (steps.array() + 1.0).prod(); voxels > 1e9)
    throw InputError("grid", "box of " + text(extent) + " mm at " + std::to_string(spacing_mm) +
                                 " mm needs " + std::to_string(voxels) +
                                 " voxels, must be at most 1e9");
  Grid grid;
  grid.size = steps.cast<int>() + Eigen::Vector3i::Ones();
  grid.spacing_mm.setConstant(spacing_mm);
  // The extent need not be a multiple of the spacing; the grid, which may be larger, is centred on
  // the box.
  grid.origin_mm = min_mm - 0.5 * (steps * spacing_mm - extent);
  return grid;
}

}  // namespace usct
