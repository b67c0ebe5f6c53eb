#include "similarity/global_moments.h"

namespace usct {

GlobalMoments::GlobalMoments(std::shared_ptr<const UltrasoundPatches> us,
                             std::shared_ptr<const PackedCt> ct, GradientChannel channel,
                             const SimilarityBackend& backend)
    : us_(std::move(us)), ct_(std::move(ct)), channel_(channel), backend_(backend) {
  const double mean = mean_of(*us_);
  means_.resize(us_->blocks.size() * kLanes);
  for (const UltrasoundPatches::Patch& patch : us_->patches) {
    const double above = patch.mean - mean;
    square_sum_ += patch.square_sum + static_cast<double>(patch.count) * above * above;
    for (std::size_t i = 0; i < patch.strands(); ++i) means_[patch.first_strand + i] = above;
  }
}

PatchMoments GlobalMoments::at(const SimilarityPose& pose, double& inside) const {
  const PatchKernelInput input = kernel_input(*us_, *ct_, pose, channel_);
  PatchMoments moments;
  moments.count = static_cast<double>(us_->count);
  moments.uu = square_sum_;
  for_blocks(backend_, input, 0, us_->blocks.size(), [&](std::size_t b, const StrandSums& sums) {
    inside += sum_of_lanes(sums.inside);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      add_strand(sums, lane, means_[b * kLanes + lane], moments);
  });
  return moments;
}

}  // namespace usct
