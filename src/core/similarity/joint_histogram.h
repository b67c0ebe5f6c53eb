#pragma once

#include <cstdint>
#include <vector>

#include "similarity/sampled_ultrasound.h"

namespace usct {

/// Entropies of a joint histogram, nats.
struct Entropies {
  double us = 0.0;
  double ct = 0.0;
  double joint = 0.0;
};

/// The joint histogram of Mattes 2003: a sample lies in one bin of the ultrasound and in four of
/// the CT's, weighted by a cubic B-spline about its value. Two extra bins at either end of the
/// window hold the spline's tails.
class JointHistogram {
 public:
  JointHistogram(SampledImages images, int bins);

  /// Calls value_of(entropies) if there is overlap.
  template <typename ValueOf>
  SimilarityValue evaluate(const SimilarityPose& pose, const ValueOf& value_of) const {
    SimilarityValue result;
    const std::vector<double> joint = at(pose, result.overlap);
    if (result.overlap > 0.0) result.value = value_of(entropies_of(joint));
    return result;
  }

 private:
  std::vector<double> at(const SimilarityPose& pose, double& overlap) const;
  Entropies entropies_of(const std::vector<double>& joint) const;

  SampledImages images_;
  int bins_;
  std::vector<std::uint8_t> us_bins_;  // one per place of UltrasoundPatches::value
};

}  // namespace usct
