#pragma once

#include "us_ct_registration/similarity/metric.h"

namespace usct {

/// Correlation ratio of the ultrasound given CT value and gradient magnitude together: the share of
/// the ultrasound's variance that a function of the two can explain, one function for all samples;
/// [0, 1].
struct JointCorrelationRatioOptions {
  static constexpr const char* kName = "joint_correlation_ratio";

  PatchOptions patches;
  /// Number of knots along the CT value, spaced evenly over its window; [8, 128].
  int bins = 24;
  /// Number of knots along the gradient, [2, 32], and the gradient at the middle knot. Knots are
  /// sparse at steep gradients, which are rare and have similar echoes.
  int gradient_bins = 8;
  double gradient_scale_hu_per_mm = 25.0;
  /// Few samples at a knot would explain it by chance, so a knot's mean is drawn towards the mean
  /// of all samples, as if this many additional samples had that mean; >= 0.
  double prior_samples = 10.0;

  SimilarityNeeds needs() const;
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, JointCorrelationRatioOptions& o) {
  fields("patches", o.patches);
  fields("bins", o.bins);
  fields("gradient_bins", o.gradient_bins);
  fields("gradient_scale_hu_per_mm", o.gradient_scale_hu_per_mm);
  fields("prior_samples", o.prior_samples);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images,
                                       const JointCorrelationRatioOptions& options);

}  // namespace usct
