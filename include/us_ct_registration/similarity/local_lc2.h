#pragma once

#include "us_ct_registration/similarity/lc2_options.h"
#include "us_ct_registration/similarity/metric.h"

namespace usct {

/// Weight of a patch in the sum: its number of samples times a power of the ultrasound's standard
/// deviation in it.
enum class PatchWeighting { kCount, kDeviation, kVariance };

constexpr auto words_of(PatchWeighting) {
  return std::array<std::pair<PatchWeighting, const char*>, 3>{
      {{PatchWeighting::kCount, "count"},
       {PatchWeighting::kDeviation, "deviation"},
       {PatchWeighting::kVariance, "variance"}}};
}

/// LC2 (Wein 2008) with one set of weights per patch (Wein 2013, Fuerst 2014): the share of the
/// ultrasound's variance that the CT value and its gradient explain; in [0, 1]. Its parts are the
/// patches.
struct LocalLc2Options : Lc2Options {
  static constexpr const char* kName = "local_lc2";

  PatchOptions patches;
  PatchWeighting weighting = PatchWeighting::kDeviation;
  /// The probe compresses shallow tissue, and the abdominal wall slides over the organs, so the
  /// weight of a patch at a depth of d mm is multiplied by d^2 / (d^2 + pressed_mm^2); [0, 200], 0:
  /// not reduced.
  double pressed_mm = 0.0;
  /// A patch contributes its explained share to this power; [0.25, 8]. Chance explains a little of
  /// every patch, true structure much of a few: a power above 1 favours those few.
  double power = 1.0;

  SimilarityNeeds needs() const;
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, LocalLc2Options& o) {
  describe(fields, static_cast<Lc2Options&>(o));
  fields("patches", o.patches);
  fields("weighting", o.weighting);
  fields("pressed_mm", o.pressed_mm);
  fields("power", o.power);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const LocalLc2Options& options);

}  // namespace usct
