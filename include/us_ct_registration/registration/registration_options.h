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
  /// If a level has more candidates than this number, they are first compared by a quarter of the
  /// samples. The best ones, as many as this number, are then compared by all samples; >=
  /// optimised. Unset: all candidates are compared by all samples.
  std::optional<int> screened;
  /// Number of candidates that are optimised, best first; >= 1.
  int optimised = 1;
  /// Number of distinct optima that are handed to the next level; >= 1.
  int kept = 1;

  void validate(const std::string& source) const;
};

/// Multi-start search, coarse to fine.
struct SearchOptions {
  /// Starts around the initial pose; unset: the initial pose alone.
  std::optional<StartOptions> starts = StartOptions{};
  /// The levels, coarse to fine; at least one. The last one is the deciding level.
  std::vector<LevelOptions> levels;
  /// Greatest number of rounds; [1, 32]. A search goes on in another round, from starts of its own,
  /// while its best optimum is refused, and is no better than chance or no firmer than a wrong
  /// pose.
  int rounds = 8;
  /// Optima closer than this (mean displacement of the field of view) count as one, mm.
  double distinct_mm = 4.0;
  /// Number of distinct optima that a round keeps; >= 1. Poses to which the refinement or blocks of
  /// the field lead from these are added to the result.
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

  void validate(const std::string& source) const;
};

/// The images and the search that the evidence is gathered with. Evidence on coarse images leaves
/// more right poses in doubt, and a search on them misses more.
enum class EvidenceSource {
  kOwn,       // those of the registration: its similarities must be 0 by chance, and not negative
  kOwnFirst,  // the same for a pose of the first round that they leave beyond doubt; for all others
              // the registration goes on as the preset `patient`, whose result it then has
  kPatient,   // those of the preset `patient`, whatever found the pose
};

constexpr auto words_of(EvidenceSource) {
  return std::array<std::pair<EvidenceSource, const char*>, 3>{
      {{EvidenceSource::kOwn, "own"},
       {EvidenceSource::kOwnFirst, "own_first"},
       {EvidenceSource::kPatient, "patient"}}};
}

/// Parts of the field: climbs from the pose by each half of the lines and of the frames, on the
/// images of the deciding level.
struct PartOptions {
  OptimizerOptions optimizer;
  /// As ClimbOptions::reach_mm.
  double reach_mm = 40.0;

  void validate(const std::string& source) const;
};

/// The expected error: the motion of the pose by parts of the field, the deformation of tissue, and
/// errors that no image shows. docs/confidence.md says how they were calibrated.
struct ErrorOptions {
  /// Factor on the standard deviation that the halves give; > 0.
  double parts_factor = 0.5;
  /// Error of the speed of sound, as a share of the depth; [0, 0.2].
  double sound_speed_share = 0.01;
  /// The rest of the error of a sweep that was corrected, as a share of the distance from its
  /// middle; [0, 0.2].
  double sweep_share = 0.035;
  /// Time between images and poses of a tracked sweep, in frames; >= 0.
  double lag_frames = 1.0;
  /// Shift by all other errors, root mean square, mm; >= 0.
  double other_mm = 0.3;
  /// The 90 % bound over the expected error; > 0.
  double bound_factor = 1.5;
  /// The expected error is that of points within this distance of the middle of the field, mm; > 0.
  double target_radius_mm = 30.0;

  void validate(const std::string& source) const;
};

struct ConfidenceOptions {
  GateLimits gates;
  EvidenceSource evidence = EvidenceSource::kOwn;
  /// An optimum farther than this from the best one is a rival, mm; a closer one lies on the slope
  /// of the best one; >= 1.
  double rival_mm = 10.0;
  /// Similarities of patches on the images of the deciding level, which did not choose the pose:
  /// almost without a ridge, where faint structure counts as well as edges, and with one. Each must
  /// be a sum over patches (SimilarityNeeds::has_parts).
  SimilarityOptions similarity;
  SimilarityOptions ridge_similarity;
  /// Patches within cubes of this edge are not independent, mm; > 0.
  double cluster_mm = 16.0;
  /// By this much clusters of patches are shifted to ask whether they would rather lie elsewhere,
  /// mm; > 0. More than a right pose is off, less than structures of the anatomy are apart.
  double cluster_step_mm = 3.0;
  PartOptions parts;
  ErrorOptions error;

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
  /// Whether the registration is made again on ultrasound whose frames lie where its images show
  /// that they do, if that is elsewhere than recorded: a motor that is slower than its probe file
  /// says, on one side or on both.
  bool correct_sweep = true;
  std::uint32_t seed = 1;

  /// The default options are those of the preset `patient`.
  RegistrationOptions();

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "registration options") const;
};

}  // namespace usct
