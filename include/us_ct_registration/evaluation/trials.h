#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/perturbation.h"
#include "us_ct_registration/evaluation/study_case.h"
#include "us_ct_registration/geometry/angles.h"

/// The trials of a study: which images are registered, and from which start.
namespace usct {

/// The kind of a trial. All kinds but kStart are negative: nothing may be accepted, except where
/// `has_truth`. The seeds of trials depend on these numbers.
enum class TrialKind {
  kStart = 0,           // the case, from a start near the truth
  kMismatched = 1,      // with the CT of another case of the group
  kMirrored = 2,        // the lines of each of its frames in reverse order
  kNoOverlap = 3,       // from a start where CT and ultrasound lie far apart
  kNoise = 4,           // its ultrasound replaced by speckle
  kFarStart = 5,        // from a start beyond the reach of an optimizer; it may succeed by chance
  kFramesReversed = 6,  // its frames in reverse order
  kHalfTurn = 7,        // lines and frames in reverse order, as if the probe was turned by 180
                        // degrees about its axis; right is the pose that is turned as well
  kCtMirrored = 8,      // its CT mirrored, left for right, about the kidney
  kCtAxesSwapped = 9,   // the second and third axis of its CT exchanged, the kidney in place
  kStranger = 10,       // with the CT of a stranger
};

/// All negative kinds, in the order of their numbers.
const std::vector<TrialKind>& negative_kinds();

/// "start", "mismatched", "mirrored", "no overlap", "noise", "far start", "frames reversed", "half
/// turn", "ct mirrored", "ct axes swapped", "stranger".
const char* kind_name(TrialKind kind);
/// The kind of that name, in which '-' stands for a blank. Throws InputError, naming `source` and
/// the right names, for any other text.
TrialKind parse_kind(const std::string& name, const std::string& source);
/// Whether there is a right answer other than to refuse.
bool has_truth(TrialKind kind);

struct Trial {
  TrialKind kind = TrialKind::kStart;
  /// Indices of the cases that give the ultrasound and the CT.
  std::size_t us_case = 0;
  std::size_t ct_case = 0;
  /// The one of StudyOptions::seeds, and the number of the trial among those of its kind, case and
  /// this seed.
  std::uint32_t study_seed = 0;
  int index = 0;
  /// Seed of all random numbers of the trial.
  std::uint64_t seed = 0;
  Eigen::Isometry3d T_us_ct_initial = Eigen::Isometry3d::Identity();
  /// Mean distance of the targets at the start from their positions by the truth (or, for a
  /// negative trial, by the pose that looks right).
  double displacement_mm = 0.0;
};

struct StudyOptions {
  /// Number of trials per case, kind and seed; >= 1.
  int starts = 9;
  /// Range of the mean displacement of the targets at the start; starts are spread evenly over its
  /// bins.
  double min_displacement_mm = 0.0;
  double max_displacement_mm = 30.0;
  int bins = 3;
  /// Largest rotation of a start.
  double max_rotation_rad = 30.0 * kDegree;
  /// If set, starts are drawn from this box and not by displacement.
  std::optional<MotionBox> box;
  /// The kinds of the trials, each at most once; not empty.
  std::vector<TrialKind> kinds{TrialKind::kStart};
  /// Displacements of far starts, and the gap of starts without overlap.
  double far_min_mm = 60.0;
  double far_max_mm = 100.0;
  double gap_mm = 150.0;
  /// Seeds of the starts, each at most once; not empty.
  std::vector<std::uint32_t> seeds{1};

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "study options") const;
};

/// All trials of the cases that are no strangers, by case, kind, seed and number. They need no
/// voxels of the cases. The trials of a case do not depend on the other cases, except for the CT of
/// mismatched trials and strangers. These CTs come in turn, strangers beginning with one that the
/// seed and the case choose.
///
/// Throws InputError if an option is invalid, there is no case, two cases have the same name, a
/// group has a single case (for mismatched trials), or there are strangers without that kind or
/// that kind without strangers.
std::vector<Trial> plan_trials(const std::vector<StudyCase>& cases, const StudyOptions& options);

/// The ultrasound of a trial, made of that of the case `own`: as it is, reversed, or noise.
PreScanVolume trial_ultrasound(const StudyCase& own, const Trial& trial);

/// The CT of a trial, made of that of `ct_case`, if it is an altered one, mirrored or with
/// exchanged axes; else none, and the CT is that of `ct_case` as it is.
std::optional<CtVolume> altered_ct(const StudyCase& ct_case, const Trial& trial);

/// Maps the US frame of the case `own` to where the ultrasound of the trial shows it: half a turn
/// of the probe, else the identity.
Eigen::Isometry3d T_shown_us(const StudyCase& own, const Trial& trial);

}  // namespace usct
