#pragma once

#include <Eigen/Core>

#include "similarity/patch_kernel.h"

/// Derivatives of the explained share of a patch by a translation of its samples. Within a patch of
/// a few millimetres any motion of the ultrasound is nearly a translation. The weights of the fit
/// depend on the translation as well and are eliminated (variable projection).
namespace usct {

/// The fit of one patch, as far as its derivatives need it. The derivative of the share by the m of
/// a sample is `um * u + mm * m + mg * g + m_offset`, that by its g is
/// `ug * u + mg * m + gg * g + g_offset`, with u, m and g of the sample as in StrandSums.
struct ShareSlopes {
  double um = 0.0, ug = 0.0;
  double mm = 0.0, mg = 0.0, gg = 0.0;
  double m_offset = 0.0, g_offset = 0.0;
  /// The weights of the fit.
  double a = 0.0, b = 0.0;
  /// Inverse of the matrix of its normal equations (m, then g), damped by the ridge; 0 for a weight
  /// that is not fitted.
  Eigen::Matrix2d inverse = Eigen::Matrix2d::Zero();
};

/// The slopes of explained_share; all 0 where that is 0.
ShareSlopes share_slopes(const PatchMoments& sums, const Lc2Ridge& ridge);

/// ShareSlopes of the patches to which the strands of a block belong, lane by lane.
struct StrandSlopes {
  float um[kLanes], ug[kLanes];
  float mm[kLanes], mg[kLanes], gg[kLanes];
  float m_offset[kLanes], g_offset[kLanes];
  float a[kLanes], b[kLanes];

  void set(std::size_t lane, const ShareSlopes& slopes);
};

/// The CT at the samples of a block, row by row; m and g as in StrandSums, and their derivatives by
/// the position in the CT, in voxels, g being differentiated as PackedCt::gradient(). All are 0
/// outside the CT.
struct BlockSamples {
  struct Row {
    float m[kLanes], g[kLanes];
    float by_m[3][kLanes], by_g[3][kLanes];
  };
  Row rows[UltrasoundPatches::kLongestStrand];
};

/// Samples the CT at a block, and sums its strands with the bits of sum_strands. The channel must
/// be GradientChannel::kMagnitude.
void sample_derivatives_scalar(const PatchKernelInput& input, std::size_t block,
                               BlockSamples& samples, StrandSums& sums);
void sample_derivatives_simd(const PatchKernelInput& input, std::size_t block,
                             BlockSamples& samples, StrandSums& sums);

/// Sums over each strand of a block. Derivatives are by the position in the CT, in voxels; d is
/// `a dm + b dg`. Products of components of d are in the order xx, yy, zz, xy, xz, yz.
struct DerivativeSums {
  float share[3][kLanes];  // derivative of the explained share
  float d[3][kLanes];
  float dm[3][kLanes], dg[3][kLanes];  // d times m and g
  float dd[6][kLanes];
};

/// Sums of the strands of a block. For DerivativeOrder::kGradient only `share` is filled in.
void sum_derivatives_scalar(const UltrasoundPatches& us, std::size_t block,
                            const BlockSamples& samples, const StrandSlopes& slopes,
                            DerivativeOrder order, DerivativeSums& sums);
void sum_derivatives_simd(const UltrasoundPatches& us, std::size_t block,
                          const BlockSamples& samples, const StrandSlopes& slopes,
                          DerivativeOrder order, DerivativeSums& sums);

/// Derivatives of a patch's explained share by a translation in the CT, in voxels.
struct ShareDerivatives {
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  /// The negative second derivative by Gauss and Newton, positive semidefinite: exact where the fit
  /// leaves no residual and there is no ridge.
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
};

/// Sums over a patch, in the order of DerivativeSums.
struct PatchDerivativeSums {
  Eigen::Vector3d share = Eigen::Vector3d::Zero();
  Eigen::Vector3d d = Eigen::Vector3d::Zero();
  Eigen::Vector3d dm = Eigen::Vector3d::Zero(), dg = Eigen::Vector3d::Zero();
  Eigen::Matrix3d dd = Eigen::Matrix3d::Zero();

  void add(const DerivativeSums& sums, std::size_t lane, DerivativeOrder order);
};

ShareDerivatives share_derivatives(const PatchMoments& moments, const ShareSlopes& slopes,
                                   const PatchDerivativeSums& sums);

/// Sums derivatives of patches to those by the pose and, of ultrasound with beams, by the errors of
/// the acquisition.
class PoseDerivatives {
 public:
  PoseDerivatives(const PatchKernelInput& input, DerivativeOrder order)
      : us_(&input.us),
        to_voxels_(input.T_index_us.linear()),
        errors_(input.errors.depth, input.errors.sweep, input.errors.unevenness),
        order_(order) {}

  /// Adds a patch of the ultrasound, times a factor.
  void add(std::size_t patch, double factor, const ShareDerivatives& share);
  void add(const PoseDerivatives& other);

  const SimilarityDerivatives::Vector& gradient() const { return gradient_; }
  const SimilarityDerivatives::Matrix& curvature() const { return curvature_; }

 private:
  /// Adds a patch whose samples move by these columns per unit of the first parameters, mm.
  template <int kParameters>
  void add(const Eigen::Matrix<double, 3, kParameters>& motion_mm, double factor,
           const ShareDerivatives& share);

  const UltrasoundPatches* us_;
  Eigen::Matrix3d to_voxels_;
  Eigen::Vector3d errors_;
  DerivativeOrder order_;
  SimilarityDerivatives::Vector gradient_ = SimilarityDerivatives::Vector::Zero();
  SimilarityDerivatives::Matrix curvature_ = SimilarityDerivatives::Matrix::Zero();
};

}  // namespace usct
