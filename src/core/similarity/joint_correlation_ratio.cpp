#include "us_ct_registration/similarity/joint_correlation_ratio.h"

#include <algorithm>
#include <cmath>

#include "similarity/pose_by_pose.h"
#include "similarity/require_metric.h"
#include "similarity/sampled_ultrasound.h"

namespace usct {
namespace {

/// eta^2 given CT value and gradient.
class JointCorrelationRatio final : public PoseByPose {
 public:
  JointCorrelationRatio(SampledImages images, const JointCorrelationRatioOptions& options)
      : images_(std::move(images)), options_(options), centred_(*images_.us) {}

 private:
  SimilarityValue value_at(const SimilarityPose& pose) const override {
    const JointSums sums =
        images_.backend.joint_sums({images_.input(pose), centred_.value.data(), options_.bins,
                                    options_.gradient_bins, options_.gradient_scale_hu_per_mm});
    SimilarityValue result;
    result.overlap = sums.inside / static_cast<double>(images_.us->count);
    if (!(sums.inside > 0.0)) return result;
    double explained = 0.0;
    for (std::size_t knot = 0; knot < sums.count.size(); ++knot)
      explained += sums.ultrasound[knot] * sums.ultrasound[knot] /
                   (sums.count[knot] + options_.prior_samples);
    result.value = explained / centred_.square_sum;
    return result;
  }

  SampledImages images_;
  JointCorrelationRatioOptions options_;
  CentredUltrasound centred_;
};

}  // namespace

SimilarityNeeds JointCorrelationRatioOptions::needs() const {
  SimilarityNeeds needs;
  needs.patches = true;
  needs.follows_depth_error = needs.follows_sweep_error = true;
  return needs;
}

void JointCorrelationRatioOptions::validate(const std::string& source) const {
  patches.validate(source);
  require_bins(bins, source);
  require(gradient_bins >= 2 && gradient_bins <= 32, source, "gradient_bins", gradient_bins,
          "within [2, 32]");
  require(is_positive(gradient_scale_hu_per_mm), source, "gradient_scale_hu_per_mm",
          gradient_scale_hu_per_mm, "finite and > 0");
  require(std::isfinite(prior_samples) && prior_samples >= 0.0, source, "prior_samples",
          prior_samples, "finite and >= 0");
}

std::shared_ptr<const Similarity> make(SimilarityImages& images,
                                       const JointCorrelationRatioOptions& options) {
  auto patches = images.patches(options.patches);
  if (!patches) return nullptr;
  return std::make_shared<JointCorrelationRatio>(
      SampledImages{std::move(patches), images.packed_ct(), images.backend()}, options);
}

}  // namespace usct
