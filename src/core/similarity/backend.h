#pragma once

#include "similarity/joint_derivatives.h"
#include "similarity/joint_sums.h"
#include "similarity/patch_derivatives.h"
#include "similarity/patch_kernel.h"

namespace usct {

/// The inner loops of all metrics of patches, in one implementation. See patch_kernel.h,
/// patch_derivatives.h, joint_sums.h and joint_derivatives.h for their definitions.
struct SimilarityBackend {
  decltype(&sum_strands_scalar) sum_strands;
  decltype(&explained_shares_scalar) explained_shares;
  decltype(&sample_derivatives_scalar) sample_derivatives;
  decltype(&sum_derivatives_scalar) sum_derivatives;
  decltype(&sample_block_scalar) sample_block;
  decltype(&joint_sums_scalar) joint_sums;
  decltype(&add_joint_derivatives_scalar) add_joint_derivatives;
};

}  // namespace usct
