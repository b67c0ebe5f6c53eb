#include "phantom/deformation.h"

#include <algorithm>
#include <cmath>

#include "random.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;

// Extent of the dent in depth and to the sides.
constexpr double kDentDepthMm = 32.0;
constexpr double kDentWidthMm = 40.0;

}  // namespace

Deformation::Deformation(const Scene& scene, double deformation_mm, double indentation_mm,
                         std::uint64_t seed)
    : indentation_mm_(indentation_mm),
      T_probe_ct_(scene.T_ct_probe.inverse()),
      pressing_(scene.T_ct_probe.linear().col(1)) {
  if (deformation_mm <= 0.0) return;
  Sequence random(seed, 0xDEF);
  for (int i = 0; i < 4; ++i) {
    const double sigma = random.between(22.0, 32.0);
    bumps_.push_back({scene.kidney_centre_ct_mm + 30.0 * random.direction(), random.direction(),
                      0.5 / (sigma * sigma)});
  }
  double largest = 0.0;
  for (const Vector3d& p : scene.kidney_surface_ct_mm)
    largest = std::max(largest, bumps_at(p).norm());
  for (Bump& bump : bumps_) bump.displacement_mm *= deformation_mm / largest;
}

Vector3d Deformation::bumps_at(const Vector3d& p_mm) const {
  Vector3d sum = Vector3d::Zero();
  for (const Bump& bump : bumps_)
    sum += std::exp(-(p_mm - bump.centre_mm).squaredNorm() * bump.inverse_two_variance) *
           bump.displacement_mm;
  return sum;
}

Vector3d Deformation::at(const Vector3d& p_mm) const {
  Vector3d sum = bumps_at(p_mm);
  if (indentation_mm_ > 0.0) {
    const Vector3d q = T_probe_ct_ * p_mm;
    const double aside = (q.x() * q.x() + q.z() * q.z()) / (2.0 * kDentWidthMm * kDentWidthMm);
    const double depth = std::max(0.0, q.y()) / kDentDepthMm;
    sum += indentation_mm_ * std::exp(-depth - aside) * pressing_;
  }
  return sum;
}

Vector3d Deformation::original(const Vector3d& p_mm) const {
  if (bumps_.empty() && indentation_mm_ == 0.0) return p_mm;
  Vector3d q = p_mm - at(p_mm);
  for (int i = 0; i < 30; ++i) {
    const Vector3d next = p_mm - at(q);
    const bool close = (next - q).squaredNorm() < 1e-6;  // a micrometre is far below any voxel
    q = next;
    if (close) break;
  }
  return q;
}

}  // namespace usct::phantom
