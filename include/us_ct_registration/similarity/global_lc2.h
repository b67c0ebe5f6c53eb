#pragma once

#include "us_ct_registration/similarity/lc2_options.h"
#include "us_ct_registration/similarity/metric.h"

namespace usct {

/// LC2 (Wein 2008) with one set of weights for all samples; in [0, 1].
struct GlobalLc2Options : Lc2Options {
  static constexpr const char* kName = "global_lc2";

  PatchOptions patches;

  SimilarityNeeds needs() const;
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, GlobalLc2Options& o) {
  describe(fields, static_cast<Lc2Options&>(o));
  fields("patches", o.patches);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const GlobalLc2Options& options);

}  // namespace usct
