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

  /// The first pair of a cell, and a position in the cell.
  struct Cell {
    std::size_t offset = 0;
    Vector3f t = Vector3f::Zero();
  };

  explicit ScalarSampler(const PatchKernelInput& in)
      : in_(in),
        M_(in.T_index_us.linear().cast<float>()),
        origin_(in.T_index_us.translation().cast<float>()),
        cells_((in.ct.grid().size - Eigen::Vector3i::Ones()).cast<float>()),
        depth_error_(static_cast<float>(in.errors.depth)),
        sweep_error_(static_cast<float>(in.errors.sweep)),
        unevenness_(static_cast<float>(in.errors.unevenness)) {}

  /// Samples the CT; false outside it.
  bool sample(std::size_t s, Sampled& ct) const {
    Cell cell;
    if (!locate(s, cell)) return false;
    ct = sample(in_.ct.pairs(), cell);
    return true;
  }

  /// Samples a volume whose words, from bit `shift` on, are pairs as PackedCt::pairs().
  template <typename Word>
  Sampled sample(const Word* words, const Cell& cell, int shift = 0) const {
    const Word* low = words + cell.offset;
    return interpolate(low, low + in_.ct.stride_k(), shift, cell.t);
  }

  /// Finds the cell of the CT in which a sample lies; false outside the CT.
  bool locate(std::size_t s, Cell& cell) const {
    const UltrasoundPatches& us = in_.us;
    Vector3f p(us.x_mm[s], us.y_mm[s], us.z_mm[s]);
    if (in_.errors.any())
      p += depth_error_ * us.depth_mm[s] * direction(s) +
           (sweep_error_ + unevenness_ * in_.us.sweep_side[s]) *
               Vector3f(us.sweep_x[s], us.sweep_y[s], us.sweep_z[s]);
    const Vector3f index = M_ * p + origin_;
    if (!((index.array() >= 0.0F).all() && (index.array() < cells_.array()).all())) return false;
    const Vector3f corner = index.array().floor();
    const Eigen::Vector3i ijk = corner.cast<int>();
    cell = {static_cast<std::size_t>(ijk.z()) * in_.ct.stride_k() +
                static_cast<std::size_t>(ijk.y()) * in_.ct.stride_j() +
                static_cast<std::size_t>(ijk.x()),
            index - corner};
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
  template <typename Word>
  static Sampled interpolate(const Word* low, const Word* high, int shift, const Vector3f& t) {
    float corner[2][2][2];  // k, j, i
    for (int k = 0; k < 2; ++k)
      for (int i = 0; i < 2; ++i) {
        const auto pair = static_cast<std::uint16_t>((k == 0 ? low : high)[i] >> shift);
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
  float unevenness_;
};

}  // namespace usct
