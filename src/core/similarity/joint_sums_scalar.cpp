#include <algorithm>
#include <cmath>

#include "similarity/joint_sums.h"

namespace usct {
namespace {

using Eigen::Vector3f;

struct Sampled {
  float value;
  Vector3f gradient;  // per voxel
};

float lerp(float a, float b, float t) { return a + t * (b - a); }

Sampled interpolate(std::uint64_t cell, const Vector3f& t) {
  const auto corner = [&](int c) { return static_cast<float>((cell >> (8 * c)) & 0xFF); };
  const Eigen::Vector4f low(corner(0), corner(2), corner(4), corner(6));
  const Eigen::Vector4f slope = Eigen::Vector4f(corner(1), corner(3), corner(5), corner(7)) - low;
  const Eigen::Vector4f edge = low + t.x() * slope;
  const float face0 = lerp(edge[0], edge[1], t.y());
  const float face1 = lerp(edge[2], edge[3], t.y());
  return {lerp(face0, face1, t.z()),
          {lerp(lerp(slope[0], slope[1], t.y()), lerp(slope[2], slope[3], t.y()), t.z()),
           lerp(edge[1] - edge[0], edge[3] - edge[2], t.z()), face1 - face0}};
}

}  // namespace

JointSums joint_sums_scalar(const JointSumsInput& in) {
  const std::size_t knots =
      static_cast<std::size_t>(in.rows) * static_cast<std::size_t>(in.columns);
  JointSums sums{in.rows, in.columns, std::vector<double>(knots), std::vector<double>(knots), 0.0};
  const Eigen::Matrix3f M = in.T_index_us.linear().cast<float>();
  const Vector3f origin = in.T_index_us.translation().cast<float>();
  const Vector3f cells = (in.ct.grid().size - Eigen::Vector3i::Ones()).cast<float>();
  const Vector3f per_mm = in.ct.grid().spacing_mm.cwiseInverse().cast<float>();
  const auto scale = static_cast<float>(in.gradient_scale_hu_per_mm / in.ct.step_hu());
  for (const UltrasoundPatches::Patch& patch : in.us.patches)
    for (std::size_t s = patch.begin; s < patch.begin + patch.count; ++s) {
      const Vector3f index = M * Vector3f(in.x_mm[s], in.y_mm[s], in.z_mm[s]) + origin;
      float value = static_cast<float>(in.ct.background());
      float gradient = 0.0F;
      if ((index.array() >= 0.0F).all() && (index.array() < cells.array()).all()) {
        const Vector3f corner = index.array().floor();
        const Eigen::Vector3i ijk = corner.cast<int>();
        const Sampled ct =
            interpolate(in.ct.cells()[static_cast<std::size_t>(ijk.z()) * in.ct.cell_stride_k() +
                                      static_cast<std::size_t>(ijk.y()) * in.ct.cell_stride_j() +
                                      static_cast<std::size_t>(ijk.x())],
                        index - corner);
        value = ct.value;
        gradient = ct.gradient.cwiseProduct(per_mm).norm();
        sums.inside += 1.0;
      }
      const float row = value * (static_cast<float>(in.rows - 1) / 255.0F);
      const float column = gradient / (gradient + scale) * static_cast<float>(in.columns - 1);
      const int r = std::min(static_cast<int>(row), in.rows - 2);
      const int c = std::min(static_cast<int>(column), in.columns - 2);
      const float u = in.us.value[s] + static_cast<float>(patch.mean);
      for (int dr = 0; dr < 2; ++dr)
        for (int dc = 0; dc < 2; ++dc) {
          const float along_row = row - static_cast<float>(r);
          const float along_column = column - static_cast<float>(c);
          const double weight = static_cast<double>(dr == 0 ? 1.0F - along_row : along_row) *
                                static_cast<double>(dc == 0 ? 1.0F - along_column : along_column);
          const auto knot = static_cast<std::size_t>((r + dr) * in.columns + c + dc);
          sums.ultrasound[knot] += weight * static_cast<double>(u);
          sums.count[knot] += weight;
        }
    }
  return sums;
}

}  // namespace usct
