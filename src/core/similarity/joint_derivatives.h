#pragma once

#include "similarity/joint_sums.h"
#include "similarity/patch_derivatives.h"

/// Derivatives of the joint correlation ratio. Its value is sum S_k^2 / (n_k + prior) over the
/// knots, with S_k the ultrasound at a knot and n_k its samples, and its best function has
/// f_k = S_k / (n_k + prior) there. A change of the shares w_k of the samples in the knots changes
/// it by sum_samples sum_k (2 f_k u - f_k^2) dw_k: the function may be held fixed, since it is the
/// best one.
namespace usct {

struct JointDerivativesInput {
  JointSumsInput sums;
  /// The function f at the knots, in the order of JointSums.
  const float* function;
};

/// Sums over samples, by a small motion of the ultrasound (SimilarityDerivatives), of the changes
/// of the value, and of the outer products of the changes of f. Products are in the order of the
/// lower triangle, row by row.
struct JointDerivatives {
  static constexpr std::size_t kProducts = 21;
  double value[6] = {};
  double function[kProducts] = {};
};

/// Adds the samples of a block, at which sample_derivatives has sampled the CT. For
/// DerivativeOrder::kGradient only `value` is summed.
void add_joint_derivatives_scalar(const JointDerivativesInput& input, std::size_t block,
                                  const BlockSamples& samples, DerivativeOrder order,
                                  JointDerivatives& sums);
void add_joint_derivatives_simd(const JointDerivativesInput& input, std::size_t block,
                                const BlockSamples& samples, DerivativeOrder order,
                                JointDerivatives& sums);

}  // namespace usct
