#include "similarity/backend.h"

#include "us_ct_registration/similarity/similarity_images.h"

namespace usct {

const SimilarityBackend& scalar_backend() {
  static constexpr SimilarityBackend kBackend{sum_strands_scalar,          explained_shares_scalar,
                                              sample_derivatives_scalar,   sum_derivatives_scalar,
                                              sample_block_scalar,         joint_sums_scalar,
                                              add_joint_derivatives_scalar};
  return kBackend;
}

const SimilarityBackend& simd_backend() {
  static constexpr SimilarityBackend kBackend{
      sum_strands_simd,  explained_shares_simd, sample_derivatives_simd,   sum_derivatives_simd,
      sample_block_simd, joint_sums_simd,       add_joint_derivatives_simd};
  return kBackend;
}

}  // namespace usct
