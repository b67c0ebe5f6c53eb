#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/progress.h"
#include "us_ct_registration/volume/hu_window.h"
#include "us_ct_registration/volume/sampling.h"
#include "us_ct_registration/volume/volume.h"

/// Ultrasound simulated from CT (Wein 2008; Xiang's thesis, eqs 4.3-4.9), along the beams of any
/// beam grid. Equation numbers below are the thesis'; docs/simulation.md says how its ambiguous
/// places are read.
///
/// This is the reference: scalar, with every intermediate image kept, and made to be read. Faster
/// kernels are held to it.
namespace usct {

/// What eq 4.7 compresses. Its print says I, the sentence before it says the reflections.
enum class LogCompression {
  /// log(1 + a min(1, s|r|)) / log(1 + a): small reflections are amplified.
  kReflection,
  /// 1 - log(1 + a I) / log(1 + a), as printed: how much of the sound has been lost on the way.
  kIntensity,
};

/// When a beam is reflected totally, so that nothing beyond is seen (thesis 4.1.1, after Gill).
struct OcclusionOptions {
  /// Whether the thresholds below count. Without them only a transmission of zero (eq 4.4) occludes
  /// (the thesis' phantoms); in a body bone and gas do (its patient).
  bool by_threshold = false;
  /// CT values from which a sample is bone, stone or metal.
  double bone_hu = 500.0;
  /// CT values below which a sample is gas; also, whether or not `by_threshold`, what is air before
  /// a beam enters the body.
  double gas_hu = -400.0;
  /// |grad mu| from which an interface reflects everything; infinite: none does.
  double gradient_hu_per_mm = std::numeric_limits<double>::infinity();
};

/// Eq 4.8: p = slope * mu + offset, a linear stand-in for Wein's curve from CT value to
/// echogenicity.
struct IntensityMap {
  double slope = 1.36;
  double offset = -1429.0;
  /// Limit p to grey values, [0, 255]. Without it p is affine in mu, and free weights undo it.
  bool clamp = true;
};

struct SimulationOptions {
  Interpolation interpolation = Interpolation::kTrilinear;
  /// CT value of what the CT does not show: soft tissue. There is no gradient towards it.
  double outside_hu = 40.0;
  /// Limits of the CT values that become mu; occlusion sees the CT as it is. Unset: no limits.
  std::optional<HuWindow> window;
  /// mu = max(HU + hu_shift, mu_floor): eqs 4.3 and 4.4 divide by mu, so that it must be positive.
  double hu_shift = 1000.0;
  double mu_floor = 50.0;
  /// The length l over which the gradient counts as a change of mu: eqs 4.3 and 4.4 take l grad mu,
  /// which makes them free of units; mm.
  double gradient_length_mm = 1.0;
  /// Path over which the beam is transmitted by one factor t (eq 4.6), mm: I then does not depend
  /// on the sample spacing. Unset: one factor per sample, as printed.
  std::optional<double> transmission_length_mm;
  OcclusionOptions occlusion;
  LogCompression log_compression = LogCompression::kReflection;
  /// a of eq 4.7.
  double log_a = 15.0;
  /// s of LogCompression::kReflection: r is of the order of 0.002, where the logarithm is linear.
  double reflection_scale = 100.0;
  /// Keep the sign of r (positive where mu rises along the beam) through the compression.
  bool signed_reflection = false;
  IntensityMap map;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "simulation options") const;
};

/// What is special about a sample; bits.
enum SampleFlag : std::uint8_t {
  kOutsideCt = 1,   // the CT does not show it
  kBeforeBody = 2,  // air of the CT in front of the body (gel, standoff or an indented skin)
  kOccluded = 4,    // I = 0
};

/// Everything that the CT alone gives: images of samples x lines x frames, samples fastest.
struct SimulatedComponents {
  int samples = 0;
  int lines = 0;
  int frames = 0;
  std::vector<float> ct_hu;                   // sampled CT; outside_hu where there is none
  std::vector<float> gradient_hu_per_mm;      // |grad mu|
  std::vector<float> reflection_coefficient;  // delta r, eq 4.3, within [-1, 1]
  std::vector<float> transmission;            // t, eq 4.4, within [0, 1]
  std::vector<float> intensity;               // I, eq 4.6
  std::vector<float> reflection;              // r, eqs 4.5 and 4.7
  std::vector<float> mapped_ct;               // p, eq 4.8
  std::vector<std::uint8_t> flags;            // SampleFlag

  std::size_t count() const { return flags.size(); }
  std::size_t offset(int sample, int line, int frame) const {
    return (static_cast<std::size_t>(frame) * static_cast<std::size_t>(lines) +
            static_cast<std::size_t>(line)) *
               static_cast<std::size_t>(samples) +
           static_cast<std::size_t>(sample);
  }
};

/// Eqs 4.3-4.8 along every beam. `T_ct_us` maps the US frame to the CT's. The same bits for any
/// number of threads.
///
/// The gradient is the difference between points one voxel ahead and one behind along each axis of
/// the CT (kept within it), divided by their distance: for trilinear sampling inside the CT the
/// interpolated central differences. Samples outside the CT, and air in front of the body, are
/// worth `outside_hu`, reflect nothing and transmit everything. The air ends at the first sample
/// whose neighbourhood (the points of its gradient) is free of it.
///
/// Throws InputError for an invalid CT, beam grid or option, and for a transform that is not finite
/// and rigid.
SimulatedComponents simulate_components(const BeamGrid& beams, const CtVolume& ct,
                                        const Eigen::Isometry3d& T_ct_us,
                                        const SimulationOptions& options,
                                        const Progress& progress = {});

/// f = mapped_ct * p + reflection * r + bias (eq 4.9: alpha, beta, gamma of the equation; the text
/// after it swaps alpha and beta).
struct SimulationWeights {
  double mapped_ct = 0.0;
  double reflection = 0.0;
  double bias = 0.0;
};

struct FitOptions {
  /// Unset: least squares against the ultrasound (the thesis' phantoms). Set: these (its patient).
  std::optional<SimulationWeights> fixed_weights;
  /// Count samples outside the CT or in front of the body as the background that they are taken
  /// for. Leaving them out would let an optimizer gain by moving out of the CT.
  bool use_background = true;
  /// Least share of the usable samples that must lie in the body shown by the CT; [0, 1].
  double min_overlap = 0.05;

  void validate(const std::string& source = "fit options") const;
};

enum class FitStatus {
  kNotFitted,
  kFitted,              // by least squares
  kFixedWeights,        // as given
  kNoUsableUltrasound,  // every sample is excluded
  kNoOverlap,           // too few usable samples lie in the CT
  kConstantUltrasound,  // the ultrasound does not vary
  kAllOccluded,         // no usable sample is insonified
  kNoContrast,          // neither p nor r varies
};
std::string to_string(FitStatus status);

/// The simulated ultrasound (eq 4.9) and how well it explains the real one.
struct SimulatedUltrasound {
  FitStatus status = FitStatus::kNotFitted;
  /// Why there is no fit; empty if there is one.
  std::string message;
  SimulationWeights weights;
  /// psi: mean of the ultrasound over occluded samples; 0 if there are none.
  double occluded_mean = 0.0;
  /// 1 - sum (U - f)^2 / (N Var U) over the usable samples, occluded ones included (1 minus the
  /// cost of eq 4.10). In [0, 1] under least squares; below 0 if fixed weights do worse than a
  /// constant.
  double lc2 = 0.0;
  /// Share of the usable samples that lie in the body shown by the CT.
  double overlap = 0.0;
  /// Usable samples N, and those of them that are occluded.
  std::size_t used = 0;
  std::size_t occluded = 0;
  /// f, samples x lines x frames, at every sample. Empty without a fit.
  std::vector<float> brightness;

  bool has_fit() const {
    return status == FitStatus::kFitted || status == FitStatus::kFixedWeights;
  }
};

/// Eq 4.9. `ultrasound` holds samples x lines x frames; `excluded` (empty, or as long) is not 0
/// where a sample must not count, as ConditionedUltrasound::reasons. Sums are taken frame by frame
/// in double precision: the same bits for any number of threads. If p and r are collinear, or one
/// is constant, the weights are the smallest of those that fit best.
///
/// Throws InputError if the sizes differ, an ultrasound sample that counts is not finite, or an
/// option is invalid. Data that cannot be fitted are no error but a status and a message.
SimulatedUltrasound fit_to_ultrasound(const SimulatedComponents& components,
                                      const std::vector<float>& ultrasound,
                                      const std::vector<std::uint8_t>& excluded,
                                      const FitOptions& options);

}  // namespace usct
