#pragma once

#include "us_ct_registration/similarity/metric.h"

namespace usct {

/// Correlation ratio eta^2 of the ultrasound given the CT value (Roche 1998); each CT value is
/// shared between the two nearest bins. The value lies in [0, 1].
struct CorrelationRatioOptions {
  static constexpr const char* kName = "correlation_ratio";

  PatchOptions patches;
  /// Number of bins that divide the window of the CT; [8, 128].
  int bins = 24;

  SimilarityNeeds needs() const;
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, CorrelationRatioOptions& o) {
  fields("patches", o.patches);
  fields("bins", o.bins);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images,
                                       const CorrelationRatioOptions& options);

}  // namespace usct
