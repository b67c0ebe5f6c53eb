#pragma once

#include "us_ct_registration/similarity/metric.h"
#include "us_ct_registration/simulation/simulation.h"

namespace usct {

/// The thesis' metric (eqs 4.3-4.10): LC2 of the ultrasound and its simulation from the CT along
/// the beams, one set of weights for all samples.
struct SimulatedLc2Options {
  static constexpr const char* kName = "simulated_lc2";

  SimulationOptions simulation;
  FitOptions fit;

  SimilarityNeeds needs() const;
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, SimulatedLc2Options& o) {
  fields("simulation", o.simulation);
  fields("fit", o.fit);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images,
                                       const SimulatedLc2Options& options);

/// The value of `simulate_components` and `fit_to_ultrasound` (see there) in one pass without
/// intermediate images, in single precision except for the sums. The lanes of SIMD vectors hold
/// neighbouring lines, with the widest instructions of the processor, and the threads share groups
/// of lines.
///
/// Unknown samples do not count. Where `fit_to_ultrasound` gives no fit the value is NaN, and only
/// the overlap is valid. Both images are copied.
///
/// AcquisitionErrors: `depth` only (finite, > -1). Evaluating throws InputError if `sweep` or
/// `unevenness` is not 0, and for a transform that is not finite and rigid.
///
/// Throws InputError if an image or an option is invalid, an ultrasound sample that counts is not
/// finite, or the CT has more than 2^30 voxels.
std::shared_ptr<const Similarity> make_simulated_lc2(const BeamUltrasound& ultrasound,
                                                     const CtVolume& ct,
                                                     const SimulationOptions& simulation,
                                                     const FitOptions& fit);

}  // namespace usct
