#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/perturbation.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/progress.h"
#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

/// A study: many registrations of cases with known truth, and their errors. study_statistics.h and
/// study_report.h make tables of it.
namespace usct {

/// A folder as `usct phantom` writes it: `ct` (.nrrd, .mha or .nii.gz), `us.nrrd`, `truth.tfm`,
/// `targets.csv` and, if positions of the targets in the CT are known, `targets_ct.csv`.
struct StudyCase {
  /// Name of the folder.
  std::string name;
  CtVolume ct;
  PreScanVolume ultrasound;
  Eigen::Isometry3d T_us_ct_true = Eigen::Isometry3d::Identity();
  /// Matched points: `targets_us_mm[i]` is where `targets_ct_mm[i]` was during the ultrasound,
  /// deformation included. Without `targets_ct.csv` nothing is known of a deformation, and
  /// `targets_ct_mm` are the points that the truth maps to `targets_us_mm`.
  std::vector<Eigen::Vector3d> targets_us_mm;
  std::vector<Eigen::Vector3d> targets_ct_mm;

  /// The name up to its first '_'.
  std::string group() const { return name.substr(0, name.find('_')); }
};

/// Throws InputError, naming the file, if one is missing or invalid, if there are several CTs, or
/// if the files of targets have different numbers of points.
StudyCase read_study_case(const std::filesystem::path& folder);

/// The kind of a trial: which images are registered, and from which start.
enum class TrialKind {
  kStart,       // the case, from a start near the truth
  kMismatched,  // with the CT of another case of the group
  kMirrored,    // its ultrasound mirrored
  kNoOverlap,   // from a start where CT and ultrasound lie far apart
  kNoise,       // its ultrasound replaced by speckle
  kFarStart,    // from a start beyond the reach of an optimizer; it may succeed by chance
};
/// "start", "mismatched", "mirrored", "no overlap", "noise", "far start".
const char* kind_name(TrialKind kind);
/// Whether there is a right answer other than to refuse.
bool has_truth(TrialKind kind);

struct Trial {
  TrialKind kind = TrialKind::kStart;
  /// Indices of the cases that give the ultrasound and the CT.
  std::size_t us_case = 0;
  std::size_t ct_case = 0;
  /// Number of the trial among those of its kind and case.
  int index = 0;
  /// Seed of all random numbers of the trial.
  std::uint64_t seed = 0;
  Eigen::Isometry3d T_us_ct_initial = Eigen::Isometry3d::Identity();
  /// Mean distance of the targets at the start from their positions by the truth (or, for a
  /// negative trial, by the pose that looks right).
  double displacement_mm = 0.0;
};

struct StudyOptions {
  /// Number of trials per case, and per kind of negative trials; >= 1.
  int starts = 9;
  /// Range of the mean displacement of the targets at the start; starts are spread evenly over its
  /// bins.
  double min_displacement_mm = 0.0;
  double max_displacement_mm = 30.0;
  int bins = 3;
  /// Largest rotation of a start.
  double max_rotation_rad = 0.5235987755982988;  // 30 degrees
  /// If set, starts are drawn from this box and not by displacement.
  std::optional<MotionBox> box;
  /// Whether the study consists of negative trials (all kinds but kStart).
  bool negatives = false;
  /// Negative trials: displacements of far starts, and the gap of starts without overlap.
  double far_min_mm = 60.0;
  double far_max_mm = 100.0;
  double gap_mm = 150.0;
  std::uint64_t seed = 1;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "study options") const;
};

/// All trials, case by case. The trials of a case do not depend on the other cases, except for the
/// CT of mismatched trials. Throws InputError if an option is invalid, there is no case, two cases
/// have the same name, or, for mismatched trials, a group has a single case.
std::vector<Trial> plan_trials(const std::vector<StudyCase>& cases, const StudyOptions& options);

/// The ultrasound of a trial: of its case, mirrored, or noise.
PreScanVolume trial_ultrasound(const std::vector<StudyCase>& cases, const Trial& trial);

/// Errors of one pose at the targets of a case.
struct PoseErrors {
  /// Against the truth of the case, which is the best rigid fit of its targets.
  TargetErrors rigid;
  /// Distances of the targets themselves. Where the kidney deformed they include what no rigid pose
  /// can remove; where it did not, or nothing is known of it, they equal `rigid`.
  TargetErrors physical;
};

/// A trial and its result.
struct StudyRun {
  Trial trial;
  std::string case_name;
  std::string group;
  std::string ct_case_name;
  RegistrationResult result;
  /// Errors at the start, of the pose if it was accepted, and of every candidate; none without
  /// truth.
  std::optional<PoseErrors> before;
  std::optional<PoseErrors> after;
  std::vector<PoseErrors> candidates;
  /// Errors that the covariance of an accepted result predicts.
  std::optional<ExpectedTargetErrors> expected;

  bool accepted() const { return result.T_us_ct.has_value(); }
  /// Wall time of the registration without files: the "total" of the result if it has one, else the
  /// sum of its steps.
  double seconds() const;
};

using Register = std::function<RegistrationResult(const PreScanVolume&, const CtVolume&,
                                                  const Eigen::Isometry3d& T_us_ct_initial)>;

enum class StudyThreads {
  kOverTrials,   // each registration on one thread: most registrations per hour
  kWithinTrial,  // one registration after the other, each on all threads: comparable times
};

/// Runs all trials on `threads` threads (>= 1). The runs have the order of the trials and, if
/// `register_one` is a pure function, do not depend on the number of threads except for their
/// times. An exception of `register_one` ends the study.
std::vector<StudyRun> run_trials(const std::vector<StudyCase>& cases,
                                 const std::vector<Trial>& trials, const Register& register_one,
                                 StudyThreads how, int threads, const Progress& progress = {});

}  // namespace usct
