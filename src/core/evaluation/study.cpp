#include "us_ct_registration/evaluation/study.h"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "parallel.h"
#include "phantom/random.h"
#include "require.h"
#include "us_ct_registration/evaluation/negative_cases.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/registration/pose_parameters.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr TrialKind kNegatives[] = {TrialKind::kMismatched, TrialKind::kMirrored,
                                    TrialKind::kNoOverlap, TrialKind::kNoise, TrialKind::kFarStart};

std::filesystem::path find_ct(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> found;
  for (const char* name : {"ct.nrrd", "ct.mha", "ct.nii.gz"})
    if (std::filesystem::exists(folder / name)) found.push_back(folder / name);
  if (found.size() != 1)
    throw InputError(folder.string(), "has " + std::to_string(found.size()) +
                                          " of ct.nrrd, ct.mha and ct.nii.gz, must have one");
  return found.front();
}

std::vector<Vector3d> read_targets_ct_mm(const std::filesystem::path& folder,
                                         const StudyCase& study_case) {
  const std::filesystem::path path = folder / "targets_ct.csv";
  if (!std::filesystem::exists(path))
    return ct_points_mm(study_case.T_us_ct_true, study_case.targets_us_mm);
  std::vector<Vector3d> points_mm = read_points_mm(path);
  if (points_mm.size() != study_case.targets_us_mm.size())
    throw InputError(path.string(), "has " + std::to_string(points_mm.size()) +
                                        " points, must have as many as targets.csv, " +
                                        std::to_string(study_case.targets_us_mm.size()));
  return points_mm;
}

/// The hash FNV-1a, which is the same on every machine.
std::uint64_t hash_of(const std::string& text) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  return hash;
}

Vector3d centroid(const std::vector<Vector3d>& points_mm) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : points_mm) sum += p;
  return sum / static_cast<double>(points_mm.size());
}

void require_cases(const std::vector<StudyCase>& cases) {
  if (cases.empty()) throw InputError("cases", "there are 0, must be at least 1");
  std::set<std::string> names;
  for (const StudyCase& study_case : cases)
    if (!names.insert(study_case.name).second)
      throw InputError("cases", "two are named '" + study_case.name + "', names must differ");
}

/// The other cases of its group, beginning with the next one.
std::vector<std::size_t> others_of_group(const std::vector<StudyCase>& cases, std::size_t own) {
  std::vector<std::size_t> others;
  for (std::size_t step = 1; step < cases.size(); ++step) {
    const std::size_t i = (own + step) % cases.size();
    if (cases[i].group() == cases[own].group()) others.push_back(i);
  }
  if (others.empty())
    throw InputError("cases", "'" + cases[own].name +
                                  "' is the only one of its group, must have another one there to "
                                  "be mismatched with");
  return others;
}

/// Plans the trials of one kind and case.
class Planner {
 public:
  Planner(const std::vector<StudyCase>& cases, std::size_t own, TrialKind kind,
          const StudyOptions& options)
      : cases_(cases), own_(own), kind_(kind), options_(options) {
    const auto purpose = static_cast<std::uint64_t>(kind);
    seed_ = phantom::hash(phantom::hash(options.seed, hash_of(cases[own].name)), purpose);
    const bool far = kind == TrialKind::kFarStart;
    displacements_mm_ = spread_displacements_mm(
        seed_, options.starts, far ? options.far_min_mm : options.min_displacement_mm,
        far ? options.far_max_mm : options.max_displacement_mm, options.bins);
  }

  Trial trial(int index) const {
    Trial trial;
    trial.kind = kind_;
    trial.us_case = trial.ct_case = own_;
    trial.index = index;
    trial.seed = phantom::hash(seed_, static_cast<std::uint64_t>(index));
    const StudyCase& own = cases_[own_];
    Isometry3d T_us_ct = own.T_us_ct_true;
    if (kind_ == TrialKind::kMismatched) {
      const std::vector<std::size_t> others = others_of_group(cases_, own_);
      trial.ct_case = others[static_cast<std::size_t>(index) % others.size()];
      const StudyCase& other = cases_[trial.ct_case];
      T_us_ct = pose_of_other_ct(T_us_ct, centroid(own.targets_us_mm),
                                 other.T_us_ct_true.inverse() * centroid(other.targets_us_mm));
    }
    trial.T_us_ct_initial = kind_ == TrialKind::kNoOverlap
                                ? moved_apart(T_us_ct, own.ct.grid, own.ultrasound.geometry,
                                              options_.gap_mm, trial.seed)
                                : motion(trial) * T_us_ct;
    trial.displacement_mm = mean_displacement_mm(trial.T_us_ct_initial * T_us_ct.inverse(),
                                                 Isometry3d::Identity(), own.targets_us_mm);
    return trial;
  }

 private:
  Isometry3d motion(const Trial& trial) const {
    const std::vector<Vector3d>& targets = cases_[own_].targets_us_mm;
    if (options_.box && kind_ != TrialKind::kFarStart)
      return random_motion_in_box(trial.seed, targets, *options_.box);
    return random_motion(trial.seed, targets,
                         displacements_mm_[static_cast<std::size_t>(trial.index)],
                         options_.max_rotation_rad);
  }

  const std::vector<StudyCase>& cases_;
  std::size_t own_;
  TrialKind kind_;
  const StudyOptions& options_;
  std::uint64_t seed_ = 0;
  std::vector<double> displacements_mm_;
};

StudyRun evaluated(const std::vector<StudyCase>& cases, const Trial& trial,
                   RegistrationResult result) {
  const StudyCase& own = cases[trial.us_case];
  StudyRun run;
  run.trial = trial;
  run.case_name = own.name;
  run.group = own.group();
  run.ct_case_name = cases[trial.ct_case].name;
  run.result = std::move(result);
  const auto errors = [&](const Isometry3d& T_us_ct) {
    return PoseErrors{evaluate_targets(T_us_ct, own.T_us_ct_true, own.targets_us_mm),
                      evaluate_matched_targets(T_us_ct, own.targets_ct_mm, own.targets_us_mm)};
  };
  if (run.accepted() && run.result.covariance)
    run.expected = expected_tre_mm(*run.result.covariance, own.targets_us_mm, own.name);
  if (!has_truth(trial.kind)) return run;
  run.before = errors(trial.T_us_ct_initial);
  if (run.accepted()) run.after = errors(*run.result.T_us_ct);
  for (const RegistrationCandidate& candidate : run.result.candidates)
    run.candidates.push_back(errors(candidate.T_us_ct));
  return run;
}

/// Sets the number of OpenMP threads within a scope. Loops within a parallel loop run on one
/// thread.
class ThreadCount {
 public:
  explicit ThreadCount(int threads)
      : threads_(omp_get_max_threads()), levels_(omp_get_max_active_levels()) {
    if (threads < 1)
      throw InputError("threads", "is " + std::to_string(threads) + ", must be >= 1");
    omp_set_num_threads(threads);
    omp_set_max_active_levels(1);
  }
  ~ThreadCount() {
    omp_set_num_threads(threads_);
    omp_set_max_active_levels(levels_);
  }
  ThreadCount(const ThreadCount&) = delete;
  ThreadCount& operator=(const ThreadCount&) = delete;

 private:
  int threads_;
  int levels_;
};

}  // namespace

StudyCase read_study_case(const std::filesystem::path& folder) {
  StudyCase study_case;
  const std::filesystem::path path = std::filesystem::absolute(folder).lexically_normal();
  study_case.name = (path.has_filename() ? path : path.parent_path()).filename().string();
  study_case.ct = read_volume<std::int16_t>(find_ct(folder));
  study_case.ultrasound = read_prescan_nrrd(folder / "us.nrrd");
  study_case.T_us_ct_true = read_T_us_ct(folder / "truth.tfm");
  study_case.targets_us_mm = read_points_mm(folder / "targets.csv");
  study_case.targets_ct_mm = read_targets_ct_mm(folder, study_case);
  return study_case;
}

const char* kind_name(TrialKind kind) {
  switch (kind) {
    case TrialKind::kStart:
      return "start";
    case TrialKind::kMismatched:
      return "mismatched";
    case TrialKind::kMirrored:
      return "mirrored";
    case TrialKind::kNoOverlap:
      return "no overlap";
    case TrialKind::kNoise:
      return "noise";
    case TrialKind::kFarStart:
      return "far start";
  }
  return "unknown";
}

bool has_truth(TrialKind kind) { return kind == TrialKind::kStart || kind == TrialKind::kFarStart; }

void StudyOptions::validate(const std::string& source) const {
  require(starts >= 1, source, "starts", starts, ">= 1");
  require(bins >= 1, source, "bins", bins, ">= 1");
  require_not_negative(source, "min_displacement_mm", min_displacement_mm);
  require(std::isfinite(max_displacement_mm) && max_displacement_mm >= min_displacement_mm, source,
          "max_displacement_mm", max_displacement_mm, "finite and >= min_displacement_mm");
  require(max_rotation_rad >= 0.0 && max_rotation_rad <= kPi, source, "max_rotation_rad",
          max_rotation_rad, "within [0, pi]");
  require_not_negative(source, "far_min_mm", far_min_mm);
  require(std::isfinite(far_max_mm) && far_max_mm >= far_min_mm, source, "far_max_mm", far_max_mm,
          "finite and >= far_min_mm");
  require_positive(source, "gap_mm", gap_mm);
  if (box) box->validate(source);
}

std::vector<Trial> plan_trials(const std::vector<StudyCase>& cases, const StudyOptions& options) {
  options.validate();
  require_cases(cases);
  std::vector<TrialKind> kinds{TrialKind::kStart};
  if (options.negatives) kinds.assign(std::begin(kNegatives), std::end(kNegatives));
  std::vector<Trial> trials;
  for (std::size_t own = 0; own < cases.size(); ++own)
    for (const TrialKind kind : kinds) {
      const Planner planner(cases, own, kind, options);
      for (int index = 0; index < options.starts; ++index) trials.push_back(planner.trial(index));
    }
  return trials;
}

PreScanVolume trial_ultrasound(const std::vector<StudyCase>& cases, const Trial& trial) {
  const PreScanVolume& ultrasound = cases[trial.us_case].ultrasound;
  if (trial.kind == TrialKind::kMirrored) return mirrored(ultrasound);
  if (trial.kind == TrialKind::kNoise) return speckle_only(ultrasound, trial.seed);
  return ultrasound;
}

double StudyRun::seconds() const {
  const auto total = result.seconds.find("total");
  if (total != result.seconds.end()) return total->second;
  double sum = 0.0;
  for (const auto& [stage, seconds] : result.seconds) sum += seconds;
  return sum;
}

std::vector<StudyRun> run_trials(const std::vector<StudyCase>& cases,
                                 const std::vector<Trial>& trials, const Register& register_one,
                                 StudyThreads how, int threads, const Progress& progress) {
  const ThreadCount thread_count(threads);
  std::vector<StudyRun> runs(trials.size());
  const auto run_one = [&](std::size_t i) {
    const Trial& trial = trials[i];
    runs[i] = evaluated(cases, trial,
                        register_one(trial_ultrasound(cases, trial), cases[trial.ct_case].ct,
                                     trial.T_us_ct_initial));
  };
  if (how == StudyThreads::kOverTrials) {
    parallel_for(
        static_cast<int>(trials.size()), [&](int i) { run_one(static_cast<std::size_t>(i)); },
        progress);
    return runs;
  }
  for (std::size_t i = 0; i < trials.size(); ++i) {
    run_one(i);
    if (progress) progress(static_cast<double>(i + 1) / static_cast<double>(trials.size()));
  }
  return runs;
}

}  // namespace usct
