#pragma once

#include "us_ct_registration/similarity/metric.h"

namespace usct {

/// Correlation ratio of the ultrasound given CT value and gradient magnitude together: how much of
/// the ultrasound's variance any function of the two explains, one function for all samples;
/// [0, 1].
struct JointCorrelationRatioOptions {
  static constexpr const char* kName = "joint_correlation_ratio";

  PatchOptions patches;
  /// Knots along the CT value, evenly over its window; [8, 128].
  int bins = 24;
  /// Knots along the gradient, [2, 32], and the gradient in the middle of them: steep gradients are
  /// rare, and echo alike.
  int gradient_bins = 8;
  double gradient_scale_hu_per_mm = 25.0;
  /// A knot that few samples share would explain them by chance: it is held to the mean of all
  /// samples as if this many more had it; >= 0.
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
