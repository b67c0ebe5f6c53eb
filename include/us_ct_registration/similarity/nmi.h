#pragma once

#include "us_ct_registration/similarity/metric.h"

namespace usct {

/// Normalised mutual information (Studholme 1999), (H(U) + H(CT)) / H(U, CT), from the same joint
/// histogram as mattes_mi.h; [1, 2].
struct NmiOptions {
  static constexpr const char* kName = "nmi";

  PatchOptions patches;
  /// Number of bins of the joint histogram per image; [8, 128]. Those of the CT divide its window,
  /// those of the ultrasound the range between its 0.5th and 99.5th percentiles.
  int bins = 24;

  SimilarityNeeds needs() const;
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, NmiOptions& o) {
  fields("patches", o.patches);
  fields("bins", o.bins);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const NmiOptions& options);

}  // namespace usct
