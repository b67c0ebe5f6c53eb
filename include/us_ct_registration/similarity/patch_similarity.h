#pragma once

#include <memory>
#include <string>

#include "us_ct_registration/similarity/packed_ct.h"
#include "us_ct_registration/similarity/similarity.h"
#include "us_ct_registration/similarity/ultrasound_patches.h"

namespace usct {

/// Which function of ultrasound and CT; all are higher where the images agree better.
enum class SimilarityKind {
  /// LC2 (Wein 2008) with one set of weights per patch (Wein 2013, Fuerst 2014): how much of the
  /// ultrasound's variance the CT value and its gradient explain, linearly, with ridge
  /// regularisation. In [0, 1].
  kLocalLc2,
  /// The same with one set of weights for all samples.
  kGlobalLc2,
  /// Normalised cross-correlation of ultrasound and CT value, over all samples; [-1, 1].
  kNcc,
  /// Mutual information of ultrasound and CT value over all samples, from a joint histogram with
  /// cubic B-spline Parzen windows along the CT value (Mattes 2003); nats, >= 0.
  kMattesMi,
  /// Normalised mutual information (Studholme 1999), (H(U) + H(CT)) / H(U, CT), of the same
  /// histogram; [1, 2].
  kNmi,
  /// Correlation ratio eta^2 of the ultrasound given the CT value (Roche 1998), CT values shared
  /// between the two nearest bins; [0, 1].
  kCorrelationRatio,
  /// The same given the CT value and its gradient's magnitude together: how much of the
  /// ultrasound's
  /// variance any function of the two explains, one function for all samples; [0, 1].
  kJointCorrelationRatio,
  /// The thesis' (Wein 2008): LC2 of the ultrasound and its simulation along the beams, see
  /// simulated_lc2.h; it has no patches and cannot be made here.
  kSimulatedLc2,
};
const char* kind_name(SimilarityKind kind);
/// "local_lc2", "global_lc2", "ncc", "mattes_mi", "nmi", "correlation_ratio",
/// "joint_correlation_ratio", "simulated_lc2". Throws InputError, naming `source`, for any other
/// text.
SimilarityKind parse_kind(const std::string& name, const std::string& source);

/// What stands beside the CT value to explain ultrasound.
enum class GradientChannel {
  kMagnitude,  // |grad mu|
  kAlongBeam,  // |d . grad mu|: what reflects a beam back to the array (eq 4.3)
};

/// What a patch weighs in the sum: its samples times a power of the ultrasound's standard
/// deviation in it.
enum class PatchWeighting { kCount, kDeviation, kVariance };

struct SimilarityOptions {
  SimilarityKind kind = SimilarityKind::kLocalLc2;
  GradientChannel channel = GradientChannel::kMagnitude;
  PatchOptions patches;
  PatchWeighting weighting = PatchWeighting::kDeviation;
  /// Of kLocalLc2: the probe presses what is near, and the wall slides over the organs, so patches
  /// at a depth of d mm weigh d^2 / (d^2 + pressed_mm^2) of that; [0, 200], 0: all of it.
  double pressed_mm = 0.0;
  /// Ridge of LC2: a patch whose CT values deviate by this much, or less, explains little. Without
  /// it noise and faint structure explain as much as an edge. 0: none.
  double ridge_intensity_hu = 20.0;
  double ridge_gradient_hu_per_mm = 40.0;
  /// LC2: the gradient may only brighten the ultrasound, as interfaces do; its weight is >= 0.
  bool positive_gradient = true;
  /// Of kLocalLc2: patches contribute the explained share to this power; [0.25, 8]. Chance explains
  /// a little of every patch, true structure much of a few: above 1 the few count.
  double power = 2.0;
  /// Of the histograms of kMattesMi, kNmi and kCorrelationRatio, per image; [8, 128]. Those of the
  /// CT divide its window, those of the ultrasound what lies between its 0.5th and 99.5th
  /// percentiles.
  int bins = 32;
  /// Of kJointCorrelationRatio: knots along the gradient (those along the CT value are `bins`), [2,
  /// 32], and the gradient in the middle of them.
  int gradient_bins = 8;
  double gradient_scale_hu_per_mm = 25.0;
  /// Use the scalar reference in place of vector instructions.
  bool scalar = false;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "similarity options") const;
};

/// What lies outside the CT counts as its background, with no gradient: leaving it out would let
/// an optimizer gain by moving out of the CT. Acquisition errors are to first order, as
/// UltrasoundPatches has them.
///
/// Throws InputError for invalid options, and if there is no patch.
std::shared_ptr<const Similarity> make_patch_similarity(
    std::shared_ptr<const UltrasoundPatches> ultrasound, std::shared_ptr<const PackedCt> ct,
    const SimilarityOptions& options);

}  // namespace usct
