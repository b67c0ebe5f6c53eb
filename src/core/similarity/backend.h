#pragma once

#include "similarity/joint_derivatives.h"
#include "similarity/joint_sums.h"
#include "similarity/patch_derivatives.h"
#include "similarity/patch_kernel.h"

namespace usct {

/// The inner loops of all metrics of patches, in one implementation. See patch_kernel.h,
/// patch_derivatives.h, joint_sums.h and joint_derivatives.h for their definitions.
class SimilarityBackend {
 public:
  virtual ~SimilarityBackend() = default;

  virtual void sum_strands(const PatchKernelInput& input, std::size_t first, std::size_t last,
                           StrandSums* sums) const = 0;
  virtual void explained_shares(const StrandSums& sums, const double* count, const double* uu,
                                const Lc2Ridge& ridge, double* shares) const = 0;
  virtual void sample_derivatives(const PatchKernelInput& input, std::size_t block,
                                  BlockSamples& samples, StrandSums& sums) const = 0;
  virtual void sum_derivatives(const UltrasoundPatches& us, std::size_t block,
                               const BlockSamples& samples, const StrandSlopes& slopes,
                               DerivativeOrder order, DerivativeSums& sums) const = 0;
  virtual std::size_t sample_block(const PatchKernelInput& input, std::size_t block,
                                   float* values) const = 0;
  virtual JointSums joint_sums(const JointSumsInput& input) const = 0;
  virtual void add_joint_derivatives(const JointDerivativesInput& input, std::size_t block,
                                     const BlockSamples& samples, DerivativeOrder order,
                                     JointDerivatives& sums) const = 0;
};

}  // namespace usct
