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

  std::optional<SimilarityDerivatives> derivatives(const SimilarityPose& pose,
                                                   DerivativeOrder order,
                                                   double above) const override {
    const JointSumsInput input = input_at(pose);
    const JointSums sums = images_.backend.joint_sums(input);
    SimilarityDerivatives result;
    result.value = value_of(sums);
    result.only_value = !(result.value.value > above);
    if (result.only_value) return result;
    std::vector<float> function;
    for (std::size_t knot = 0; knot < sums.count.size(); ++knot)
      function.push_back(mean_at(sums, knot));
    const auto samples = std::make_unique<BlockSamples>();
    StrandSums unused;
    JointDerivatives derivatives;
    for (std::size_t block = 0; block < images_.us->blocks.size(); ++block) {
      images_.backend.sample_derivatives(input.samples, block, *samples, unused);
      images_.backend.add_joint_derivatives({input, function.data()}, block, *samples, order,
                                            derivatives);
    }
    std::size_t at = 0;
    for (int p = 0; p < 6; ++p) {
      result.gradient[p] = derivatives.value[p] / centred_.square_sum;
      for (int q = 0; q <= p; ++q, ++at)
        result.curvature(p, q) = result.curvature(q, p) =
            2.0 * derivatives.function[at] / centred_.square_sum;
    }
    return result;
  }

 private:
  JointSumsInput input_at(const SimilarityPose& pose) const {
    return {images_.input(pose), centred_.value.data(), options_.bins, options_.gradient_bins,
            options_.gradient_scale_hu_per_mm};
  }

  /// The best function at a knot.
  float mean_at(const JointSums& sums, std::size_t knot) const {
    const double count = sums.count[knot] + options_.prior_samples;
    return count > 0.0 ? static_cast<float>(sums.ultrasound[knot] / count) : 0.0F;
  }

  SimilarityValue value_at(const SimilarityPose& pose) const override {
    return value_of(images_.backend.joint_sums(input_at(pose)));
  }

  SimilarityValue value_of(const JointSums& sums) const {
    SimilarityValue result;
    result.overlap = sums.inside / static_cast<double>(images_.us->count);
    if (!(sums.inside > 0.0)) return result;
    double explained = 0.0;
    for (std::size_t knot = 0; knot < sums.count.size(); ++knot) {
      const double count = sums.count[knot] + options_.prior_samples;
      if (count > 0.0) explained += sums.ultrasound[knot] * sums.ultrasound[knot] / count;
    }
    result.value = explained / centred_.square_sum;
    return result;
  }

  SampledImages images_;
  JointCorrelationRatioOptions options_;
  CentredUltrasound centred_;
};

}  // namespace

SimilarityNeeds JointCorrelationRatioOptions::needs() const {
  SimilarityNeeds needs = needs_of_patches();
  needs.has_derivatives = true;
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
