#include "similarity/backend.h"
#include "us_ct_registration/similarity/similarity_images.h"

namespace usct {
namespace {

class SimdBackend final : public SimilarityBackend {
 public:
  void sum_strands(const PatchKernelInput& input, std::size_t first, std::size_t last,
                   StrandSums* sums) const override {
    sum_strands_simd(input, first, last, sums);
  }
  void explained_shares(const StrandSums& sums, const double* count, const double* uu,
                        const Lc2Ridge& ridge, double* shares) const override {
    explained_shares_simd(sums, count, uu, ridge, shares);
  }
  void sample_derivatives(const PatchKernelInput& input, std::size_t block, BlockSamples& samples,
                          StrandSums& sums) const override {
    sample_derivatives_simd(input, block, samples, sums);
  }
  void sum_derivatives(const UltrasoundPatches& us, std::size_t block, const BlockSamples& samples,
                       const StrandSlopes& slopes, DerivativeOrder order,
                       DerivativeSums& sums) const override {
    sum_derivatives_simd(us, block, samples, slopes, order, sums);
  }
  std::size_t sample_block(const PatchKernelInput& input, std::size_t block,
                           float* values) const override {
    return sample_block_simd(input, block, values);
  }
  JointSums joint_sums(const JointSumsInput& input) const override {
    return joint_sums_simd(input);
  }
  void add_joint_derivatives(const JointDerivativesInput& input, std::size_t block,
                             const BlockSamples& samples, DerivativeOrder order,
                             JointDerivatives& sums) const override {
    add_joint_derivatives_simd(input, block, samples, order, sums);
  }
};

}  // namespace

const SimilarityBackend& simd_backend() {
  static const SimdBackend backend;
  return backend;
}

}  // namespace usct
