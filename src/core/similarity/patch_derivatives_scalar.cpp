#include "similarity/patch_derivatives.h"
#include "similarity/scalar_sampler.h"

namespace usct {

// With D the damped matrix of the normal equations, M the undamped one, h = (um, ug), R = D - M and
// w = (a, b) = D^-1 h, the explained sum of squares is E = 2 w.h - w.M w. Its differential is
//   dE = 2 (w + q).dh - (w + 2 q).dM w,   q = D^-1 R w,
// since dw = D^-1 (dh - dM w) and h - M w = R w.
ShareSlopes share_slopes(const PatchMoments& sums, const Lc2Ridge& ridge) {
  const Lc2Fit fit = lc2_fit(sums, ridge);
  ShareSlopes slopes;
  if (!(sums.uu > 0.0) || !(explained_share(sums, ridge) > 0.0)) return slopes;
  const double determinant = fit.damped_mm * fit.damped_gg - fit.mg * fit.mg;
  if (fit.both)
    slopes.inverse << fit.damped_gg / determinant, -fit.mg / determinant, -fit.mg / determinant,
        fit.damped_mm / determinant;
  else
    slopes.inverse(0, 0) = 1.0 / fit.damped_mm;
  const Eigen::Vector2d w(fit.a, fit.b);
  const Eigen::Vector2d q = slopes.inverse * Eigen::Vector2d((fit.damped_mm - fit.mm) * w[0],
                                                             (fit.damped_gg - fit.gg) * w[1]);
  const Eigen::Vector2d by_h = 2.0 / sums.uu * (w + q);
  const Eigen::Vector2d v = (w + 2.0 * q) / sums.uu;
  slopes.um = by_h[0];
  slopes.ug = by_h[1];
  slopes.mm = -2.0 * v[0] * w[0];
  slopes.gg = -2.0 * v[1] * w[1];
  slopes.mg = -(v[0] * w[1] + v[1] * w[0]);
  // The moments are about the means.
  slopes.m_offset = -(slopes.mm * sums.m + slopes.mg * sums.g) / sums.count;
  slopes.g_offset = -(slopes.mg * sums.m + slopes.gg * sums.g) / sums.count;
  slopes.a = w[0];
  slopes.b = w[1];
  return slopes;
}

void StrandSlopes::set(std::size_t lane, const ShareSlopes& slopes) {
  um[lane] = static_cast<float>(slopes.um);
  ug[lane] = static_cast<float>(slopes.ug);
  mm[lane] = static_cast<float>(slopes.mm);
  mg[lane] = static_cast<float>(slopes.mg);
  gg[lane] = static_cast<float>(slopes.gg);
  m_offset[lane] = static_cast<float>(slopes.m_offset);
  g_offset[lane] = static_cast<float>(slopes.g_offset);
  a[lane] = static_cast<float>(slopes.a);
  b[lane] = static_cast<float>(slopes.b);
}

void sample_derivatives_scalar(const PatchKernelInput& in, std::size_t block, BlockSamples& samples,
                               StrandSums& sums) {
  const ScalarSampler sampler(in);
  const PackedGradient gradient = in.ct.gradient();
  const auto per_step = static_cast<float>(gradient.step_per_mm);
  const auto background = static_cast<float>(in.ct.background());
  const std::size_t begin = in.us.blocks[block].begin;
  sum_strands_scalar(in, block, block + 1, &sums);
  for (std::size_t i = 0; i < in.us.blocks[block].rows * kLanes; ++i) {
    ScalarSampler::Cell cell;
    const bool inside = sampler.locate(begin + i, cell);
    ScalarSampler::Sampled ct{background, Eigen::Vector3f::Zero()};
    Eigen::Vector3f by_g = Eigen::Vector3f::Zero();
    if (inside) {
      ct = sampler.sample(in.ct.pairs(), cell);
      by_g = per_step * sampler.sample(gradient.words, cell, 16).gradient;
    }
    BlockSamples::Row& row = samples.rows[i / kLanes];
    const std::size_t lane = i % kLanes;
    row.m[lane] = ct.value - background;
    row.g[lane] = inside ? sampler.gradient(begin + i, ct) : 0.0F;
    for (int axis = 0; axis < 3; ++axis) {
      row.by_m[axis][lane] = ct.gradient[axis];
      row.by_g[axis][lane] = by_g[axis];
    }
  }
}

void sum_derivatives_scalar(const UltrasoundPatches& us, std::size_t block,
                            const BlockSamples& samples, const StrandSlopes& slopes,
                            DerivativeOrder order, DerivativeSums& sums) {
  sums = {};
  for (std::size_t i = 0; i < us.blocks[block].rows * kLanes; ++i) {
    const std::size_t lane = i % kLanes;
    const float u = us.value[us.blocks[block].begin + i];
    const BlockSamples::Row& row = samples.rows[i / kLanes];
    const float m = row.m[lane];
    const float g = row.g[lane];
    const float alpha =
        slopes.um[lane] * u + slopes.mm[lane] * m + slopes.mg[lane] * g + slopes.m_offset[lane];
    const float beta =
        slopes.ug[lane] * u + slopes.mg[lane] * m + slopes.gg[lane] * g + slopes.g_offset[lane];
    float d[3];
    for (int axis = 0; axis < 3; ++axis) {
      sums.share[axis][lane] += alpha * row.by_m[axis][lane] + beta * row.by_g[axis][lane];
      d[axis] = slopes.a[lane] * row.by_m[axis][lane] + slopes.b[lane] * row.by_g[axis][lane];
    }
    if (order == DerivativeOrder::kGradient) continue;
    constexpr int kPairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
    for (int axis = 0; axis < 3; ++axis) {
      sums.d[axis][lane] += d[axis];
      sums.dm[axis][lane] += d[axis] * m;
      sums.dg[axis][lane] += d[axis] * g;
      sums.dd[axis][lane] += d[axis] * d[axis];
      sums.dd[3 + axis][lane] += d[kPairs[axis][0]] * d[kPairs[axis][1]];
    }
  }
}

void PatchDerivativeSums::add(const DerivativeSums& sums, std::size_t lane, DerivativeOrder order) {
  for (int axis = 0; axis < 3; ++axis) {
    share[axis] += sums.share[axis][lane];
    if (order == DerivativeOrder::kGradient) continue;
    d[axis] += sums.d[axis][lane];
    dm[axis] += sums.dm[axis][lane];
    dg[axis] += sums.dg[axis][lane];
    dd(axis, axis) += sums.dd[axis][lane];
  }
  if (order == DerivativeOrder::kGradient) return;
  dd(0, 1) = dd(1, 0) += sums.dd[3][lane];
  dd(0, 2) = dd(2, 0) += sums.dd[4][lane];
  dd(1, 2) = dd(2, 1) += sums.dd[5][lane];
}

// d is projected off what a change of offset and weights takes up (Kaufman 1975).
ShareDerivatives share_derivatives(const PatchMoments& moments, const ShareSlopes& slopes,
                                   const PatchDerivativeSums& sums) {
  if (!(moments.uu > 0.0)) return {};
  const double n = moments.count;
  Eigen::Matrix<double, 3, 2> by_weights;
  by_weights << sums.dm - sums.d * (moments.m / n), sums.dg - sums.d * (moments.g / n);
  const Eigen::Matrix3d squares = sums.dd - sums.d * sums.d.transpose() / n -
                                  by_weights * slopes.inverse * by_weights.transpose();
  return {sums.share, 2.0 / moments.uu * squares};
}

namespace {

/// How a place moves per unit of the motion of SimilarityDerivatives, mm.
Eigen::Matrix<double, 3, SimilarityDerivatives::kMotion> motion_of(const Eigen::Vector3d& place) {
  Eigen::Matrix<double, 3, SimilarityDerivatives::kMotion> motion;
  motion << 0.0, place.z(), -place.y(), 1.0, 0.0, 0.0,  //
      -place.z(), 0.0, place.x(), 0.0, 1.0, 0.0,        //
      place.y(), -place.x(), 0.0, 0.0, 0.0, 1.0;
  return motion;
}

}  // namespace

template <int kParameters>
void PoseDerivatives::add(const Eigen::Matrix<double, 3, kParameters>& motion_mm, double factor,
                          const ShareDerivatives& share) {
  const Eigen::Vector3d force = factor * to_voxels_.transpose() * share.gradient;
  gradient_.head<kParameters>() += motion_mm.transpose() * force;
  if (order_ == DerivativeOrder::kGradient) return;
  const Eigen::Matrix<double, 3, kParameters> voxels = to_voxels_ * motion_mm;
  curvature_.topLeftCorner<kParameters, kParameters>() +=
      factor * voxels.transpose() * share.curvature * voxels;
}

void PoseDerivatives::add(std::size_t patch, double factor, const ShareDerivatives& share) {
  const Eigen::Vector3d& centre_us_mm = us_->patches[patch].centre_us_mm;
  if (!us_->has_beams()) return add(motion_of(centre_us_mm), factor, share);
  const Eigen::Matrix3d& by_errors_mm = us_->by_errors_mm[patch];
  Eigen::Matrix<double, 3, SimilarityDerivatives::kCount> motion_mm;
  motion_mm << motion_of(centre_us_mm + by_errors_mm * errors_), by_errors_mm;
  add(motion_mm, factor, share);
}

void PoseDerivatives::add(const PoseDerivatives& other) {
  gradient_ += other.gradient_;
  curvature_ += other.curvature_;
}

}  // namespace usct
