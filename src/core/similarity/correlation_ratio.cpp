#include "us_ct_registration/similarity/correlation_ratio.h"

#include <algorithm>
#include <cmath>

#include "similarity/packed_ct.h"
#include "similarity/pose_by_pose.h"
#include "similarity/require_metric.h"
#include "similarity/sampled_ultrasound.h"

namespace usct {
namespace {

/// eta^2 = 1 - E[Var(U | CT)] / Var(U).
class CorrelationRatio final : public PoseByPose {
 public:
  CorrelationRatio(SampledImages images, const CorrelationRatioOptions& options)
      : images_(std::move(images)), bins_(options.bins), centred_(*images_.us) {}

 private:
  struct Bin {
    double count = 0.0;
    double sum = 0.0;  // sum of the ultrasound minus its mean
    void add(float weight, float value) {
      count += weight;
      sum += weight * value;
    }
  };

  SimilarityValue value_at(const SimilarityPose& pose) const override {
    const float scale = static_cast<float>(bins_ - 1) / kLargestByte;
    std::vector<Bin> bins(static_cast<std::size_t>(bins_));
    SimilarityValue result;
    result.overlap =
        for_samples(images_.backend, images_.input(pose), [&](std::size_t place, float ct) {
          const float value = centred_.value[place];
          if (std::isnan(value)) return;
          const float at = ct * scale;
          const int bin = std::min(static_cast<int>(at), bins_ - 2);
          const float share = at - static_cast<float>(bin);
          Bin* lower = bins.data() + bin;
          lower[0].add(1.0F - share, value);
          lower[1].add(share, value);
        });
    if (result.overlap == 0.0) return result;
    double explained = 0.0;
    for (const Bin& bin : bins)
      if (bin.count > 0.0) explained += bin.sum * bin.sum / bin.count;
    result.value = std::clamp(explained / centred_.square_sum, 0.0, 1.0);
    return result;
  }

  SampledImages images_;
  int bins_;
  CentredUltrasound centred_;
};

}  // namespace

SimilarityNeeds CorrelationRatioOptions::needs() const { return needs_of_patches(); }

void CorrelationRatioOptions::validate(const std::string& source) const {
  patches.validate(source);
  require_bins(bins, source);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images,
                                       const CorrelationRatioOptions& options) {
  auto patches = images.patches(options.patches);
  if (!patches) return nullptr;
  return std::make_shared<CorrelationRatio>(
      SampledImages{std::move(patches), images.packed_ct(), images.backend()}, options);
}

}  // namespace usct
