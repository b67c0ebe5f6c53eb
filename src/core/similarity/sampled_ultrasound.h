#pragma once

#include <array>
#include <memory>
#include <vector>

#include "similarity/backend.h"

/// Ultrasound and CT value sample by sample, for the metrics of histograms.
namespace usct {

/// The ultrasound at each place of UltrasoundPatches::value; NaN at padding.
std::vector<float> ultrasound_of(const UltrasoundPatches& us);

/// The values of ultrasound_of minus the mean of all samples.
struct CentredUltrasound {
  explicit CentredUltrasound(const UltrasoundPatches& us);
  std::vector<float> value;
  double square_sum = 0.0;
};

/// Calls use(place, CT value in steps of a byte) for all places, padding included; returns the
/// overlap.
template <typename Use>
double for_samples(const SimilarityBackend& backend, const PatchKernelInput& input,
                   const Use& use) {
  std::array<float, kLanes * UltrasoundPatches::kLongestStrand> values;
  std::size_t inside = 0;
  for (std::size_t b = 0; b < input.us.blocks.size(); ++b) {
    inside += backend.sample_block(input, b, values.data());
    const std::size_t begin = input.us.blocks[b].begin;
    const std::size_t count = input.us.blocks[b].rows * kLanes;
    for (std::size_t i = 0; i < count; ++i) use(begin + i, values[i]);
  }
  return static_cast<double>(inside) / static_cast<double>(input.us.count);
}

/// The images that a metric of histograms keeps.
struct SampledImages {
  std::shared_ptr<const UltrasoundPatches> us;
  std::shared_ptr<const PackedCt> ct;
  const SimilarityBackend& backend;

  PatchKernelInput input(const SimilarityPose& pose) const {
    return kernel_input(*us, *ct, pose, GradientChannel::kMagnitude);
  }
};

}  // namespace usct
