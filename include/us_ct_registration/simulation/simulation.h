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
/// beam grid. Equation numbers below are those of the thesis; docs/simulation.md says how its
/// ambiguous places are read.
///
/// This is the scalar reference: it keeps every intermediate image, and is written to be read.
/// Tests compare faster kernels with it.
namespace usct {

/// The quantity that eq 4.7 compresses. As printed it is I; by the sentence before the equation it
/// is the reflections.
enum class LogCompression {
  /// log(1 + a min(1, s|r|)) / log(1 + a), which amplifies small reflections.
  kReflection,
  /// 1 - log(1 + a I) / log(1 + a), as printed: the share of the sound that has been lost on the
  /// way, on a logarithmic scale.
  kIntensity,
};

/// Rules by which a beam is reflected totally, so that everything beyond is occluded (thesis 4.1.1,
/// after Gill).
struct OcclusionOptions {
  /// Whether the thresholds below apply. Without them only a transmission of zero (eq 4.4)
  /// occludes, as for the phantoms of the thesis; with them bone and gas do as well, as for its
  /// patient.
  bool by_threshold = false;
  /// Samples with at least this CT value are bone, stone or metal.
  double bone_hu = 500.0;
  /// Samples with a CT value below this are gas. It also tells the air before a beam enters the
  /// body, whether or not `by_threshold` is set.
  double gas_hu = -400.0;
  /// An interface with at least this |grad mu| reflects everything; infinite: no interface does.
  double gradient_hu_per_mm = std::numeric_limits<double>::infinity();
  /// Length along the beam for which what reflects totally keeps echoing, mm: the bright line of a
  /// bone's surface. Its samples have the reflection of the surface and are not occluded. Unset:
  /// the surface itself is occluded already, as eq 4.9 says.
  std::optional<double> echo_mm;

  /// The echo of a surface covers this many samples of a beam.
  int echo_samples(double spacing_mm) const;
};

/// Eq 4.8: p = slope * mu + offset, a linear stand-in for Wein's curve from CT value to
/// echogenicity.
struct IntensityMap {
  double slope = 1.36;
  double offset = -1429.0;
  /// Whether p is limited to grey values, [0, 255]. Without the limit p is affine in mu, and fitted
  /// weights undo the map.
  bool clamp = true;
};

struct SimulationOptions {
  Interpolation interpolation = Interpolation::kTrilinear;
  /// CT value of samples outside the CT, that of soft tissue. There is no gradient towards them.
  double outside_hu = 40.0;
  /// Range to which CT values are limited before they become mu; occlusion uses the CT values as
  /// they are. Unset: no limits.
  std::optional<HuWindow> window;
  /// mu = max(HU + hu_shift, mu_floor); mu must be positive, since eqs 4.3 and 4.4 divide by it.
  double hu_shift = 1000.0;
  double mu_floor = 50.0;
  /// Length l over which the gradient counts as a change of mu, mm: eqs 4.3 and 4.4 use l grad mu
  /// in place of grad mu, which makes them dimensionless.
  double gradient_length_mm = 1.0;
  /// Length of the path to which one factor t of eq 4.6 belongs, mm, so that I does not depend on
  /// the sample spacing. Unset: one factor per sample, as printed.
  std::optional<double> transmission_length_mm;
  OcclusionOptions occlusion;
  LogCompression log_compression = LogCompression::kReflection;
  /// The constant a of eq 4.7.
  double log_a = 15.0;
  /// The factor s of LogCompression::kReflection: r is of the order of 0.002, where the logarithm
  /// is linear.
  double reflection_scale = 100.0;
  /// Whether the sign of r (positive where mu rises along the beam) is kept through the
  /// compression.
  bool signed_reflection = false;
  IntensityMap map;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "simulation options") const;
};

/// Flags of a sample; bits.
enum SampleFlag : std::uint8_t {
  kOutsideCt = 1,   // lies outside the CT
  kBeforeBody = 2,  // air in the CT in front of the body (gel, standoff or an indented skin)
  kOccluded = 4,    // I = 0, beyond the echo of what reflects totally
};

/// The images that follow from the CT and the pose, before any fit to the ultrasound; samples x
/// lines x frames, samples fastest.
struct SimulatedComponents {
  int samples = 0;
  int lines = 0;
  int frames = 0;
  std::vector<float> ct_hu;                   // sampled CT; outside_hu outside the CT
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

/// Computes eqs 4.3-4.8 along every beam. `T_ct_us` maps the US frame to the frame of the CT. The
/// result has the same bits for any number of threads.
///
/// The gradient is the difference between points one voxel ahead and one voxel behind along each
/// axis of the CT, divided by their distance; the points are kept within the CT. Inside the CT,
/// trilinear sampling thus gives interpolated central differences. Samples outside the CT, and in
/// air in front of the body, have the value `outside_hu`, reflect nothing and transmit everything.
/// The air in front of the body ends at the first sample at which none of the points of the
/// gradient lies in air.
///
/// Throws InputError for an invalid CT, beam grid or option, and for a transform that is not finite
/// and rigid.
SimulatedComponents simulate_components(const BeamGrid& beams, const CtVolume& ct,
                                        const Eigen::Isometry3d& T_ct_us,
                                        const SimulationOptions& options,
                                        const Progress& progress = {});

/// Weights of eq 4.9, f = mapped_ct * p + reflection * r + bias: alpha, beta and gamma of the
/// equation (the text after it swaps alpha and beta).
struct SimulationWeights {
  double mapped_ct = 0.0;
  double reflection = 0.0;
  double bias = 0.0;
};

struct FitOptions {
  /// Unset: weights by least squares against the ultrasound, as for the phantoms of the thesis.
  /// Set: these weights, as for its patient.
  std::optional<SimulationWeights> fixed_weights;
  /// Whether samples outside the CT or in front of the body count, with the value of the
  /// background. Leaving them out would let an optimizer gain by moving out of the CT.
  bool use_background = true;
  /// Least share of the usable samples that must lie in the part of the body that the CT shows; [0,
  /// 1].
  double min_overlap = 0.05;

  void validate(const std::string& source = "fit options") const;
};

enum class FitStatus {
  kNotFitted,
  kFitted,              // weights by least squares
  kFixedWeights,        // the given weights were used
  kNoUsableUltrasound,  // every sample is excluded
  kNoOverlap,           // too few usable samples lie in the CT
  kConstantUltrasound,  // the ultrasound does not vary
  kAllOccluded,         // no usable sample is insonified
  kNoContrast,          // neither p nor r varies
};
std::string to_string(FitStatus status);

/// The simulated ultrasound (eq 4.9) and its agreement with the real one.
struct SimulatedUltrasound {
  FitStatus status = FitStatus::kNotFitted;
  /// The reason why there is no fit; empty if there is one.
  std::string message;
  SimulationWeights weights;
  /// psi, the mean of the ultrasound over occluded samples; 0 if there are none.
  double occluded_mean = 0.0;
  /// 1 - sum (U - f)^2 / (N Var U) over the usable samples, occluded ones included (1 minus the
  /// cost of eq 4.10). In [0, 1] under least squares; below 0 if fixed weights do worse than a
  /// constant.
  double lc2 = 0.0;
  /// Share of the usable samples that lie in the part of the body that the CT shows.
  double overlap = 0.0;
  /// Number N of usable samples that count, and how many of them are occluded.
  std::size_t used = 0;
  std::size_t occluded = 0;
  /// The simulated brightness f at every sample, samples x lines x frames. Empty without a fit.
  std::vector<float> brightness;

  bool has_fit() const {
    return status == FitStatus::kFitted || status == FitStatus::kFixedWeights;
  }
};

/// Fits eq 4.9. `ultrasound` holds samples x lines x frames. `excluded` is empty or has the same
/// size, and is not 0 where a sample must not count, like ConditionedUltrasound::reasons. Sums are
/// taken frame by frame in double precision, so that the result has the same bits for any number of
/// threads. If p and r are collinear, or one of them is constant, the weights are the smallest of
/// those that fit best.
///
/// Throws InputError if the sizes differ, an ultrasound sample that counts is not finite, or an
/// option is invalid. If the data cannot be fitted, the result has a status and a message that say
/// why.
SimulatedUltrasound fit_to_ultrasound(const SimulatedComponents& components,
                                      const std::vector<float>& ultrasound,
                                      const std::vector<std::uint8_t>& excluded,
                                      const FitOptions& options);

}  // namespace usct
