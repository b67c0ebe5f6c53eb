#include <cmath>

#include "similarity/patch_sums.h"

namespace usct {
namespace {

using Eigen::Vector3f;

/// Value relative to the background, and gradient per voxel.
struct Sampled {
  float value;
  Vector3f gradient;
};

float lerp(float a, float b, float t) { return a + t * (b - a); }

/// Trilinear interpolation within a cell, and its derivative.
Sampled interpolate(std::uint64_t cell, const Vector3f& t) {
  float corner[2][2][2];  // k, j, i
  for (int c = 0; c < 8; ++c)
    corner[c >> 2][(c >> 1) & 1][c & 1] = static_cast<float>((cell >> (8 * c)) & 0xFF);
  float edge[2][2];
  float slope_i[2][2];
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 2; ++j) {
      slope_i[k][j] = corner[k][j][1] - corner[k][j][0];
      edge[k][j] = lerp(corner[k][j][0], corner[k][j][1], t.x());
    }
  const float face[2] = {lerp(edge[0][0], edge[0][1], t.y()), lerp(edge[1][0], edge[1][1], t.y())};
  return {lerp(face[0], face[1], t.z()),
          {lerp(lerp(slope_i[0][0], slope_i[0][1], t.y()),
                lerp(slope_i[1][0], slope_i[1][1], t.y()), t.z()),
           lerp(edge[0][1] - edge[0][0], edge[1][1] - edge[1][0], t.z()), face[1] - face[0]}};
}

}  // namespace

void sum_patches_scalar(const PatchSumsInput& in, PatchSums* sums) {
  const Eigen::Matrix3f M = in.T_index_us.linear().cast<float>();
  const Vector3f origin = in.T_index_us.translation().cast<float>();
  const Vector3f cells = (in.ct.grid().size - Eigen::Vector3i::Ones()).cast<float>();
  const Vector3f per_mm = in.ct.grid().spacing_mm.cwiseInverse().cast<float>();
  const auto background = static_cast<float>(in.ct.background());
  for (const UltrasoundPatches::Patch& patch : in.us.patches) {
    PatchSums sum;
    for (std::size_t s = patch.begin; s < patch.begin + patch.count; ++s) {
      const Vector3f index = M * Vector3f(in.x_mm[s], in.y_mm[s], in.z_mm[s]) + origin;
      if (!((index.array() >= 0.0F).all() && (index.array() < cells.array()).all())) continue;
      const Vector3f corner = index.array().floor();
      const Eigen::Vector3i ijk = corner.cast<int>();
      const std::uint64_t cell =
          in.ct.cells()[static_cast<std::size_t>(ijk.z()) * in.ct.cell_stride_k() +
                        static_cast<std::size_t>(ijk.y()) * in.ct.cell_stride_j() +
                        static_cast<std::size_t>(ijk.x())];
      const Sampled ct = interpolate(cell, index - corner);
      const Vector3f direction(in.us.direction_x[s], in.us.direction_y[s], in.us.direction_z[s]);
      const float m = ct.value - background;
      const float g = in.channel == GradientChannel::kMagnitude
                          ? ct.gradient.cwiseProduct(per_mm).norm()
                          : std::abs(ct.gradient.dot(M * direction));
      const float u = in.us.value[s];
      sum.inside += 1.0F;
      sum.m += m;
      sum.g += g;
      sum.mm += m * m;
      sum.gg += g * g;
      sum.mg += m * g;
      sum.um += u * m;
      sum.ug += u * g;
    }
    *sums++ = sum;
  }
}

}  // namespace usct
