#pragma once

#include <memory>
#include <vector>

#include "similarity/strand_sums.h"
#include "us_ct_registration/similarity/similarity.h"

namespace usct {

/// Sums of ultrasound, CT value and gradient over all samples.
class GlobalMoments {
 public:
  GlobalMoments(std::shared_ptr<const UltrasoundPatches> us, std::shared_ptr<const PackedCt> ct,
                GradientChannel channel, const SimilarityBackend& backend);

  /// Calls value_of(moments) if there is overlap.
  template <typename ValueOf>
  SimilarityValue evaluate(const SimilarityPose& pose, const ValueOf& value_of) const {
    double inside = 0.0;
    const PatchMoments moments = at(pose, inside);
    if (inside == 0.0) return {};
    return {value_of(moments), inside / moments.count};
  }
  const PackedCt& ct() const { return *ct_; }

 private:
  PatchMoments at(const SimilarityPose& pose, double& inside) const;

  std::shared_ptr<const UltrasoundPatches> us_;
  std::shared_ptr<const PackedCt> ct_;
  GradientChannel channel_;
  const SimilarityBackend& backend_;
  double square_sum_ = 0.0;    // squared deviations of the ultrasound from its mean
  std::vector<double> means_;  // mean of each strand's patch minus the overall mean
};

}  // namespace usct
