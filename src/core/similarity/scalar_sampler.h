#pragma once

#include <cmath>

#include "similarity/patch_kernel.h"

namespace usct {

/// The CT at the samples of the ultrasound.
class ScalarSampler {
 public:
  using Vector3f = Eigen::Vector3f;

  /// CT value, and gradient per voxel.
  struct Sampled {
    float value;
    Vector3f gradient;
  };

  explicit ScalarSampler(const PatchKernelInput& in)
      : in_(in),
        M_(in.T_index_us.linear().cast<float>()),
        origin_(in.T_index_us.translation().cast<float>()),
        cells_((in.ct.grid().size - Eigen::Vector3i::Ones()).cast<float>()),
        depth_error_(static_cast<float>(in.errors.depth)),
        sweep_error_(static_cast<float>(in.errors.sweep)) {}

  /// Samples the CT; false outside it.
  bool sample(std::size_t s, Sampled& ct) const {
    const UltrasoundPatches& us = in_.us;
    Vector3f p(us.x_mm[s], us.y_mm[s], us.z_mm[s]);
    if (is_moved(in_.errors))
      p += depth_error_ * us.depth_mm[s] * direction(s) +
           sweep_error_ * Vector3f(us.sweep_x[s], us.sweep_y[s], us.sweep_z[s]);
    const Vector3f index = M_ * p + origin_;
    if (!((index.array() >= 0.0F).all() && (index.array() < cells_.array()).all())) return false;
    const Vector3f corner = index.array().floor();
    const Eigen::Vector3i ijk = corner.cast<int>();
    const std::uint16_t* pairs =
        in_.ct.pairs().data() + static_cast<std::size_t>(ijk.z()) * in_.ct.stride_k() +
        static_cast<std::size_t>(ijk.y()) * in_.ct.stride_j() + static_cast<std::size_t>(ijk.x());
    ct = interpolate(pairs, pairs + in_.ct.stride_k(), index - corner);
    return true;
  }

  float gradient(std::size_t s, const Sampled& ct) const {
    if (in_.channel == GradientChannel::kAlongBeam)
      return std::abs(ct.gradient.dot(M_ * direction(s)));
    return ct.gradient.cwiseQuotient(in_.ct.grid().spacing_mm.cast<float>()).norm();
  }

 private:
  static float lerp(float a, float b, float t) { return a + t * (b - a); }

  /// Trilinear interpolation within a cell (pairs at k and k + 1), and its derivative.
  static Sampled interpolate(const std::uint16_t* low, const std::uint16_t* high,
                             const Vector3f& t) {
    float corner[2][2][2];  // k, j, i
    for (int k = 0; k < 2; ++k)
      for (int i = 0; i < 2; ++i) {
        const std::uint16_t pair = (k == 0 ? low : high)[i];
        corner[k][0][i] = static_cast<float>(pair & 0xFF);
        corner[k][1][i] = static_cast<float>(pair >> 8);
      }
    float edge[2][2];
    float slope_i[2][2];
    for (int k = 0; k < 2; ++k)
      for (int j = 0; j < 2; ++j) {
        slope_i[k][j] = corner[k][j][1] - corner[k][j][0];
        edge[k][j] = lerp(corner[k][j][0], corner[k][j][1], t.x());
      }
    const float face[2] = {lerp(edge[0][0], edge[0][1], t.y()),
                           lerp(edge[1][0], edge[1][1], t.y())};
    return {lerp(face[0], face[1], t.z()),
            {lerp(lerp(slope_i[0][0], slope_i[0][1], t.y()),
                  lerp(slope_i[1][0], slope_i[1][1], t.y()), t.z()),
             lerp(edge[0][1] - edge[0][0], edge[1][1] - edge[1][0], t.z()), face[1] - face[0]}};
  }

  Vector3f direction(std::size_t s) const {
    return {in_.us.direction_x[s], in_.us.direction_y[s], in_.us.direction_z[s]};
  }

  const PatchKernelInput& in_;
  Eigen::Matrix3f M_;
  Vector3f origin_;
  Vector3f cells_;
  float depth_error_;
  float sweep_error_;
};

}  // namespace usct
