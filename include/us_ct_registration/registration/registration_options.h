#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/optimizer/optimizer.h"
#include "us_ct_registration/registration/gates.h"
#include "us_ct_registration/registration/starts.h"
#include "us_ct_registration/similarity/catalogue.h"
#include "us_ct_registration/ultrasound/conditioning.h"
#include "us_ct_registration/volume/hu_window.h"

/// The options of a registration by role. All defaults together are the preset `patient`.
namespace usct {

/// A similarity on images of one resolution, and how it is climbed.
struct ClimbOptions {
  /// Ultrasound samples and CT voxels are averaged to about this spacing; unset: no averaging.
  std::optional<double> spacing_mm = 2.0;
  SimilarityOptions similarity;
  /// The optimizer's own seed is not used; RegistrationOptions::seed is.
  OptimizerOptions optimizer;
  /// Greatest distance of an optimizer from its start, along each pose parameter, mm.
  double reach_mm = 40.0;

  void validate(const std::string& source) const;
};

/// One level of the search. Its candidates are the starts or the optima of the level before; the
/// best candidates are optimised, and the best distinct optima go to the next level.
struct LevelOptions : ClimbOptions {
  /// Number of candidates that are optimised, best first; >= 1.
  int optimised = 1;
  /// Number of distinct optima that are handed to the next level; >= 1.
  int kept = 1;

  void validate(const std::string& source) const;
};

/// A search whose best optimum does not pass the gates goes on in further rounds.
struct RoundOptions {
  /// Greatest number of rounds; [1, 6].
  int most = 3;
  /// Round r, counted from 0, has growth^r times the starts of the first; [1, 16].
  int growth = 4;
  /// From the second round on, the levels optimise and keep breadth * growth^r times as many optima
  /// as in the first, the deciding level deciding_breadth * growth^r times: an optimum that the
  /// first round missed has hundreds of equals at the coarse levels; [1, 64].
  int breadth = 8;
  int deciding_breadth = 4;
  /// Every other round (the second, the fourth...) spreads its starts over this share of the region
  /// and climbs straight at the deciding level: an optimum that only that level shows has a narrow
  /// peak, which is found if starts are dense; (0, 1].
  double near_share = 0.5;

  void validate(const std::string& source) const;
};

/// Multi-start search, coarse to fine.
struct SearchOptions {
  /// Starts around the initial pose; unset: the initial pose alone.
  std::optional<StartOptions> starts = StartOptions{};
  /// The levels, coarse to fine; at least one. The last one is the deciding level.
  std::vector<LevelOptions> levels;
  RoundOptions rounds;
  /// Optima closer than this (mean displacement of the field of view) count as one, mm.
  double distinct_mm = 4.0;
  /// Number of distinct optima that are kept at the end; >= 1.
  int most_optima = 16;
  /// The part of the CT that the search uses is the field of view at the initial pose, grown by the
  /// translations of the starts, by their rotations times the field's radius, and by this margin,
  /// mm, which leaves room for optimizers and smoothing.
  double ct_margin_mm = 15.0;
  /// Rotations beyond this angle, rad, do not enlarge that part further: the field is about as wide
  /// as it is deep, so that it stays in about the same place; > 0.
  double ct_most_turn_rad = 1.2;

  void validate(const std::string& source) const;
};

/// The refinement of the best optimum of the search.
struct RefinementOptions : ClimbOptions {
  /// The CT is prepared anew around the best optimum, with this margin, mm (or the reach, if that
  /// is less).
  double ct_margin_mm = 10.0;
  /// Greatest size of each of the AcquisitionErrors that are estimated along with the pose, [0,
  /// 0.2]; 0: not estimated. An error that the similarity cannot follow is refused.
  double depth_error = 0.0;
  double sweep_error = 0.0;

  void validate(const std::string& source) const;
};

/// Poses where nothing fits give the background of a similarity. (A value by itself says little: it
/// depends on noise, contrast and the field of view.)
struct BackgroundOptions {
  /// Number of background poses; >= 16.
  int count = 64;
  /// Poses are spread like the starts or, if there are none, over a box of this half width.
  double spread_rad = 20.0 * kDegree;
  double spread_mm = 25.0;
  /// Only poses farther than this from the best optimum count, mm; >= 0.
  double away_mm = 10.0;

  void validate(const std::string& source) const;
};

/// Scatter of the pose among the parts of a second similarity, which did not choose the pose. At a
/// right pose the parts agree; at a pose that only looks right they do not.
struct ScatterOptions {
  /// Similarity on the images of the deciding level. One without parts gives no scatter.
  SimilarityOptions similarity;
  /// A quadratic is fitted to that similarity at poses this far from the found pose, mm; > 0.
  double around_mm = 3.0;
  /// Lower bound of the curvature in any direction, as a share of the largest; (0, 1].
  double least_curvature = 0.03;

  void validate(const std::string& source) const;
};

struct ConfidenceOptions {
  GateLimits gates;
  BackgroundOptions background;
  /// An optimum farther than this from the best one is a rival, mm; a closer one lies on the slope
  /// of the best one; >= 0.
  double rival_mm = 10.0;
  ScatterOptions scatter;
  /// Covariance: a factor on the standard deviations that the ultrasound's patches give, since the
  /// errors of patches are correlated; and a shift of the field (root mean square, mm) for errors
  /// that no image shows: sound speed, deformation and the like. Both are calibrated
  /// (docs/accuracy.md).
  double deviation_factor = 4.0;
  double systematic_mm = 0.8;

  void validate(const std::string& source) const;
};

/// The kind of beams for which the options are meant.
enum class BeamKind {
  kAny,
  kParallel,  // variant A of the thesis; other beams are refused
};

constexpr auto words_of(BeamKind) {
  return std::array<std::pair<BeamKind, const char*>, 2>{
      {{BeamKind::kAny, "any"}, {BeamKind::kParallel, "parallel"}}};
}

struct RegistrationOptions {
  BeamKind beams = BeamKind::kAny;
  /// Window of CT values that count, and the CT value outside the CT.
  HuWindow window;
  double outside_hu = 40.0;
  /// The ultrasound is averaged to about this spacing before it is conditioned; unset: no
  /// averaging.
  std::optional<double> conditioning_spacing_mm = 1.0;
  ConditioningOptions conditioning;
  SearchOptions search;
  /// If unset, the best optimum of the search is the result.
  std::optional<RefinementOptions> refinement;
  ConfidenceOptions confidence;
  std::uint32_t seed = 1;

  /// The default options are those of the preset `patient`.
  RegistrationOptions();

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "registration options") const;
};

}  // namespace usct
