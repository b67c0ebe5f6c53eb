#include <algorithm>
#include <cmath>

#include "similarity/patch_kernel.h"

namespace usct {
namespace {

using Eigen::Vector3f;

/// Value, and gradient per voxel.
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

/// The CT at the samples of the ultrasound.
class Sampler {
 public:
  explicit Sampler(const PatchKernelInput& in)
      : in_(in),
        M_(in.T_index_us.linear().cast<float>()),
        origin_(in.T_index_us.translation().cast<float>()),
        cells_((in.ct.grid().size - Eigen::Vector3i::Ones()).cast<float>()),
        depth_error_(static_cast<float>(in.errors.depth)),
        sweep_error_(static_cast<float>(in.errors.sweep)) {}

  /// False outside the CT.
  bool sample(std::size_t s, Sampled& ct) const {
    const UltrasoundPatches& us = in_.us;
    Vector3f p(us.x_mm[s], us.y_mm[s], us.z_mm[s]);
    p += depth_error_ * us.depth_mm[s] * direction(s) +
         sweep_error_ * Vector3f(us.sweep_x[s], us.sweep_y[s], us.sweep_z[s]);
    const Vector3f index = M_ * p + origin_;
    if (!((index.array() >= 0.0F).all() && (index.array() < cells_.array()).all())) return false;
    const Vector3f corner = index.array().floor();
    const Eigen::Vector3i ijk = corner.cast<int>();
    ct = interpolate(in_.ct.cells()[static_cast<std::size_t>(ijk.z()) * in_.ct.cell_stride_k() +
                                    static_cast<std::size_t>(ijk.y()) * in_.ct.cell_stride_j() +
                                    static_cast<std::size_t>(ijk.x())],
                     index - corner);
    return true;
  }

  float gradient(std::size_t s, const Sampled& ct) const {
    if (in_.channel == GradientChannel::kAlongBeam)
      return std::abs(ct.gradient.dot(M_ * direction(s)));
    return ct.gradient.cwiseQuotient(in_.ct.grid().spacing_mm.cast<float>()).norm();
  }

 private:
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

}  // namespace

void sum_strands_scalar(const PatchKernelInput& in, std::size_t first, std::size_t last,
                        StrandSums* sums) {
  const Sampler sampler(in);
  const auto background = static_cast<float>(in.ct.background());
  for (std::size_t b = first; b < last; ++b) {
    StrandSums sum{};
    const UltrasoundPatches::Block& block = in.us.blocks[b];
    for (std::size_t i = 0; i < block.rows * kLanes; ++i) {
      const std::size_t s = block.begin + i;
      const std::size_t lane = i % kLanes;
      Sampled ct;
      if (!sampler.sample(s, ct)) continue;
      const float m = ct.value - background;
      const float g = sampler.gradient(s, ct);
      const float u = in.us.value[s];
      sum.inside[lane] += 1.0F;
      sum.m[lane] += m;
      sum.g[lane] += g;
      sum.mm[lane] += m * m;
      sum.gg[lane] += g * g;
      sum.mg[lane] += m * g;
      sum.um[lane] += u * m;
      sum.ug[lane] += u * g;
    }
    *sums++ = sum;
  }
}

std::size_t sample_block_scalar(const PatchKernelInput& in, std::size_t block, float* values) {
  const Sampler sampler(in);
  const std::size_t begin = in.us.blocks[block].begin;
  const std::size_t end = begin + in.us.blocks[block].rows * kLanes;
  std::size_t inside = 0;
  for (std::size_t s = begin; s < end; ++s) {
    Sampled ct;
    const bool is_inside = sampler.sample(s, ct);
    inside += is_inside ? 1 : 0;
    *values++ = is_inside ? ct.value : static_cast<float>(in.ct.background());
  }
  return inside;
}

std::size_t add_joint_scalar(const PatchKernelInput& in, std::size_t block, const float* ultrasound,
                             JointSums& sums) {
  const Sampler sampler(in);
  const std::size_t begin = in.us.blocks[block].begin;
  const std::size_t end = begin + in.us.blocks[block].rows * kLanes;
  std::size_t inside = 0;
  for (std::size_t s = begin; s < end; ++s) {
    const float u = ultrasound[s];
    if (std::isnan(u)) continue;
    Sampled ct;
    const bool is_inside = sampler.sample(s, ct);
    inside += is_inside ? 1 : 0;
    const float value = is_inside ? ct.value : static_cast<float>(in.ct.background());
    const float gradient = is_inside ? sampler.gradient(s, ct) : 0.0F;
    const float row = value * (static_cast<float>(sums.rows - 1) / 255.0F);
    const float column =
        gradient / (gradient + sums.gradient_scale) * static_cast<float>(sums.columns - 1);
    const int r = std::min(static_cast<int>(row), sums.rows - 2);
    const int c = std::min(static_cast<int>(column), sums.columns - 2);
    const float along_row = row - static_cast<float>(r);
    const float along_column = column - static_cast<float>(c);
    float* table = sums.tables.data() + s % JointSums::kTables * sums.table_size();
    for (int i = 0; i < 4; ++i) {
      const float weight = ((i & 2) != 0 ? along_row : 1.0F - along_row) *
                           ((i & 1) != 0 ? along_column : 1.0F - along_column);
      float* knot = table + 2 * ((r + (i >> 1)) * sums.columns + c + (i & 1));
      knot[0] += weight * u;
      knot[1] += weight;
    }
  }
  return inside;
}

double explained_share(const PatchMoments& sums, const Lc2Ridge& ridge) {
  const double per_sample = sums.count > 0.0 ? 1.0 / sums.count : 0.0;
  const double mm = sums.mm - sums.m * sums.m * per_sample;
  const double gg = sums.gg - sums.g * sums.g * per_sample;
  const double mg = sums.mg - sums.m * sums.g * per_sample;
  const double damped_mm =
      mm + kLc2Floor * sums.mm + sums.count * ridge.intensity * ridge.intensity;
  const double damped_gg = gg + kLc2Floor * sums.gg + sums.count * ridge.gradient * ridge.gradient;
  const double determinant = damped_mm * damped_gg - mg * mg;
  double a = (damped_gg * sums.um - mg * sums.ug) / determinant;
  double b = (damped_mm * sums.ug - mg * sums.um) / determinant;
  if (!(determinant > 0.0) || (ridge.positive_gradient && b < 0.0)) {
    a = damped_mm > 0.0 ? sums.um / damped_mm : 0.0;
    b = 0.0;
  }
  const double explained =
      2.0 * (a * sums.um + b * sums.ug) - (a * a * mm + 2.0 * a * b * mg + b * b * gg);
  return sums.uu > 0.0 ? std::clamp(explained / sums.uu, 0.0, 1.0) : 0.0;
}

void explained_shares_scalar(const StrandSums& sums, const double* count, const double* uu,
                             const Lc2Ridge& ridge, double* shares) {
  for (std::size_t i = 0; i < kLanes; ++i)
    shares[i] = explained_share({count[i], uu[i], sums.m[i], sums.g[i], sums.mm[i], sums.gg[i],
                                 sums.mg[i], sums.um[i], sums.ug[i]},
                                ridge);
}

}  // namespace usct
