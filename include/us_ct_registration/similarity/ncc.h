#pragma once

#include "us_ct_registration/similarity/metric.h"

namespace usct {

/// Normalised cross-correlation of ultrasound and CT value, over all samples; [-1, 1].
struct NccOptions {
  static constexpr const char* kName = "ncc";

  PatchOptions patches;

  SimilarityNeeds needs() const;
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, NccOptions& o) {
  fields("patches", o.patches);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const NccOptions& options);

}  // namespace usct
