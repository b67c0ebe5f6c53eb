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
  /// Ultrasound samples and CT voxels are averaged to about this spacing; unset: neither is.
  std::optional<double> spacing_mm = 2.0;
  SimilarityOptions similarity;
  /// Its seed is not used: RegistrationOptions::seed is.
  OptimizerOptions optimizer;
  /// Farthest that an optimizer may go from where it starts, along each pose parameter, mm.
  double reach_mm = 40.0;

  void validate(const std::string& source) const;
};

/// One level of the search. Candidates come in (the starts, or what the level before kept), the
/// best are optimised, and the best distinct optima are handed on.
struct LevelOptions : ClimbOptions {
  /// Number of candidates that are optimised, best first; >= 1.
  int optimised = 1;
  /// Number of distinct optima that are handed to the next level; >= 1.
  int kept = 1;

  void validate(const std::string& source) const;
};

/// A search whose best optimum does not pass the gates goes on in further rounds.
struct RoundOptions {
  /// Rounds at most; [1, 6].
  int most = 3;
  /// Round r, counted from 0, has growth^r times the starts of the first; [1, 16].
  int growth = 4;
  /// From the second round on, the levels optimise and keep breadth * growth^r times as many
  /// optima as in the first, the deciding level deciding_breadth * growth^r times: what the first
  /// round did not find is one of hundreds of equals at the coarse levels; [1, 64].
  int breadth = 8;
  int deciding_breadth = 4;
  /// Every other round (the second, the fourth...) spreads its starts over this share of the
  /// region and climbs straight at the deciding level: what only that level shows has a narrow
  /// peak, which is found where starts are dense; (0, 1].
  double near_share = 0.5;

  void validate(const std::string& source) const;
};

/// Multi-start search, coarse to fine.
struct SearchOptions {
  /// Starts around the initial pose; unset: the initial pose alone.
  std::optional<StartOptions> starts = StartOptions{};
  /// Coarse to fine; at least one. The last one decides: its optima are ranked.
  std::vector<LevelOptions> levels;
  RoundOptions rounds;
  /// Optima closer than this (mean displacement of the field of view) are one, mm.
  double distinct_mm = 4.0;
  /// Number of distinct optima that are kept at the end; >= 1.
  int most_optima = 16;
  /// The CT that the search may look at: the field of view at the initial pose, grown by the
  /// translations of the starts, by their rotations times the field's radius, and by this margin,
  /// mm, in which optimizers go on and smoothing looks around.
  double ct_margin_mm = 15.0;
  /// Rotations larger than this many radians are not counted further there: the field is about as
  /// wide as it is deep, so that what turns further stays in about the same place; > 0.
  double ct_most_turn_rad = 1.2;

  void validate(const std::string& source) const;
};

/// The last fraction of a millimetre, from the best optimum of the search.
struct RefinementOptions : ClimbOptions {
  /// The CT is made again around the best optimum, with this margin, mm (or the reach, if that is
  /// less).
  double ct_margin_mm = 10.0;
  /// Estimate AcquisitionErrors along with the pose: how far each may be from 0, [0, 0.2]; 0: not
  /// estimated. Refused where the similarity cannot follow the error.
  double depth_error = 0.0;
  double sweep_error = 0.0;

  void validate(const std::string& source) const;
};

/// Poses where nothing fits show what a similarity is worth there. (The value itself says little:
/// it depends on noise, contrast and the field of view.)
struct BackgroundOptions {
  /// Number of background poses; >= 16.
  int count = 64;
  /// They are spread like the starts; where there are no starts, over a box of this half width.
  double spread_rad = 20.0 * kDegree;
  double spread_mm = 25.0;
  /// Only poses farther than this from the best one count, mm; >= 0.
  double away_mm = 10.0;

  void validate(const std::string& source) const;
};

/// Scatter of the pose among the parts of a second similarity, which did not choose the pose. At a
/// right pose the parts agree; at a pose that only looks right they do not.
struct ScatterOptions {
  /// On the images of the deciding level. A similarity without parts measures nothing.
  SimilarityOptions similarity;
  /// A quadratic is fitted to it at poses this far from the found one, mm; > 0.
  double around_mm = 3.0;
  /// Directions whose curvature is below this share of the largest count as this flat; (0, 1].
  double least_curvature = 0.03;

  void validate(const std::string& source) const;
};

struct ConfidenceOptions {
  GateLimits gates;
  BackgroundOptions background;
  /// An optimum farther than this from the best one is a rival, mm; what is closer is the slope of
  /// the best one; >= 0.
  double rival_mm = 10.0;
  ScatterOptions scatter;
  /// Covariance: factor on the standard deviations that the ultrasound's patches give (they are not
  /// independent, and err together), and what no image shows: shift of the field (root mean square)
  /// by sound speed, deformation and the like, mm. Both by calibration (docs/accuracy.md).
  double deviation_factor = 4.0;
  double systematic_mm = 0.8;

  void validate(const std::string& source) const;
};

/// Which beams the options are meant for.
enum class BeamKind {
  kAny,
  kParallel,  // variant A of the thesis: others are refused
};

constexpr auto words_of(BeamKind) {
  return std::array<std::pair<BeamKind, const char*>, 2>{
      {{BeamKind::kAny, "any"}, {BeamKind::kParallel, "parallel"}}};
}

struct RegistrationOptions {
  BeamKind beams = BeamKind::kAny;
  /// CT values that count, and what lies outside the CT.
  HuWindow window;
  double outside_hu = 40.0;
  /// The ultrasound is averaged to about this spacing before it is conditioned; unset: it is not.
  std::optional<double> conditioning_spacing_mm = 1.0;
  ConditioningOptions conditioning;
  SearchOptions search;
  /// Unset: the best optimum of the search is the result.
  std::optional<RefinementOptions> refinement;
  ConfidenceOptions confidence;
  std::uint32_t seed = 1;

  /// The default options are those of the preset `patient`.
  RegistrationOptions();

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "registration options") const;
};

}  // namespace usct
