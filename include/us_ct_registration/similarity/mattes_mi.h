#pragma once

#include "us_ct_registration/similarity/metric.h"

namespace usct {

/// Mutual information of ultrasound and CT value over all samples, from a joint histogram with
/// cubic B-spline Parzen windows along the CT value (Mattes 2003); nats, >= 0.
struct MattesMiOptions {
  static constexpr const char* kName = "mattes_mi";

  PatchOptions patches;
  /// Number of bins of the joint histogram per image; [8, 128]. Those of the CT divide its window,
  /// those of the ultrasound the range between its 0.5th and 99.5th percentiles.
  int bins = 24;

  SimilarityNeeds needs() const;
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, MattesMiOptions& o) {
  fields("patches", o.patches);
  fields("bins", o.bins);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const MattesMiOptions& options);

}  // namespace usct
