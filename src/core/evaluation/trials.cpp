#include "us_ct_registration/evaluation/trials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "evaluation/negative_cases.h"
#include "random.h"
#include "require.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/registration/pose_parameters.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

struct NamedKind {
  TrialKind kind;
  const char* name;
};
constexpr std::array<NamedKind, 11> kKinds{{{TrialKind::kStart, "start"},
                                            {TrialKind::kMismatched, "mismatched"},
                                            {TrialKind::kMirrored, "mirrored"},
                                            {TrialKind::kNoOverlap, "no overlap"},
                                            {TrialKind::kNoise, "noise"},
                                            {TrialKind::kFarStart, "far start"},
                                            {TrialKind::kFramesReversed, "frames reversed"},
                                            {TrialKind::kHalfTurn, "half turn"},
                                            {TrialKind::kCtMirrored, "ct mirrored"},
                                            {TrialKind::kCtAxesSwapped, "ct axes swapped"},
                                            {TrialKind::kStranger, "stranger"}}};

std::string replaced(std::string text, char from, char to) {
  std::replace(text.begin(), text.end(), from, to);
  return text;
}

/// The hash FNV-1a, which is the same on every machine.
std::uint64_t hash_of(const std::string& text) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  return hash;
}

std::vector<std::size_t> strangers_of(const std::vector<StudyCase>& cases) {
  std::vector<std::size_t> strangers;
  for (std::size_t i = 0; i < cases.size(); ++i)
    if (cases[i].is_stranger) strangers.push_back(i);
  return strangers;
}

void require_cases(const std::vector<StudyCase>& cases, const std::vector<TrialKind>& kinds) {
  const bool strangers = !strangers_of(cases).empty();
  if (strangers_of(cases).size() == cases.size())
    throw InputError("cases", "there are 0, must be at least 1");
  std::set<std::string> names;
  for (const StudyCase& study_case : cases)
    if (!names.insert(study_case.name).second)
      throw InputError("cases", "two are named '" + study_case.name + "', names must differ");
  const bool wanted = std::find(kinds.begin(), kinds.end(), TrialKind::kStranger) != kinds.end();
  if (strangers && !wanted)
    throw InputError("strangers", "are given, but 'stranger' is not among the kinds of trials");
  if (wanted && !strangers)
    throw InputError("strangers", "there are 0, must be at least 1 for trials of kind 'stranger'");
}

/// Throws InputError unless there are values, which all differ.
template <typename T, typename NameOf>
void require_each_once(const std::vector<T>& values, const std::string& source, const char* key,
                       const NameOf& name_of) {
  const std::string list = std::string("'") + key + "' ";
  if (values.empty()) throw InputError(source, list + "is empty, must have at least 1");
  std::set<T> seen;
  for (const T& value : values)
    if (!seen.insert(value).second)
      throw InputError(source,
                       list + "has '" + name_of(value) + "' twice, must have each at most once");
}

/// The strangers that are other subjects than a case.
std::vector<std::size_t> strangers_to(const std::vector<StudyCase>& cases, std::size_t own) {
  std::vector<std::size_t> strangers = strangers_of(cases);
  strangers.erase(
      std::remove_if(strangers.begin(), strangers.end(),
                     [&](std::size_t i) { return cases[i].subject() == cases[own].subject(); }),
      strangers.end());
  if (strangers.empty())
    throw InputError("strangers", "all are of the subject '" + cases[own].subject() + "' as '" +
                                      cases[own].name +
                                      "', must have another one there to be a stranger to it");
  return strangers;
}

/// The other subjects of its group, beginning with the next one.
std::vector<std::size_t> others_of_group(const std::vector<StudyCase>& cases, std::size_t own) {
  std::vector<std::size_t> others;
  for (std::size_t step = 1; step < cases.size(); ++step) {
    const std::size_t i = (own + step) % cases.size();
    if (!cases[i].is_stranger && cases[i].group() == cases[own].group() &&
        cases[i].subject() != cases[own].subject())
      others.push_back(i);
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
          std::uint32_t study_seed, const StudyOptions& options)
      : cases_(cases), own_(own), kind_(kind), study_seed_(study_seed), options_(options) {
    const auto purpose = static_cast<std::uint64_t>(kind);
    seed_ = hash(hash(study_seed, hash_of(cases[own].name)), purpose);
    const bool far = kind == TrialKind::kFarStart;
    displacements_mm_ = spread_displacements_mm(
        seed_, options.starts, far ? options.far_min_mm : options.min_displacement_mm,
        far ? options.far_max_mm : options.max_displacement_mm, options.bins);
    if (kind == TrialKind::kMismatched) {
      ct_cases_ = others_of_group(cases, own);
    } else if (kind == TrialKind::kStranger) {
      ct_cases_ = strangers_to(cases, own);
      const auto first = static_cast<std::ptrdiff_t>(seed_ % ct_cases_.size());
      std::rotate(ct_cases_.begin(), ct_cases_.begin() + first, ct_cases_.end());
    }
  }

  Trial trial(int index) const {
    Trial trial;
    trial.kind = kind_;
    trial.us_case = trial.ct_case = own_;
    trial.study_seed = study_seed_;
    trial.index = index;
    trial.seed = hash(seed_, static_cast<std::uint64_t>(index));
    const StudyCase& own = cases_[own_];
    Isometry3d T_us_ct = own.T_us_ct_true;
    if (!ct_cases_.empty()) {
      trial.ct_case = ct_cases_[static_cast<std::size_t>(index) % ct_cases_.size()];
      T_us_ct = pose_of_other_ct(T_us_ct, own.centre_us_mm(), cases_[trial.ct_case].centre_ct_mm());
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
  std::uint32_t study_seed_;
  const StudyOptions& options_;
  std::uint64_t seed_ = 0;
  std::vector<double> displacements_mm_;
  /// The other cases whose CTs are taken in turn; empty if it is the own CT.
  std::vector<std::size_t> ct_cases_;
};

}  // namespace

const std::vector<TrialKind>& negative_kinds() {
  static const std::vector<TrialKind> kinds = [] {
    std::vector<TrialKind> all;
    for (const NamedKind& named : kKinds)
      if (named.kind != TrialKind::kStart) all.push_back(named.kind);
    return all;
  }();
  return kinds;
}

const char* kind_name(TrialKind kind) {
  for (const NamedKind& named : kKinds)
    if (named.kind == kind) return named.name;
  return "unknown";
}

TrialKind parse_kind(const std::string& name, const std::string& source) {
  std::string names;
  for (const NamedKind& named : kKinds) {
    const std::string right = replaced(named.name, ' ', '-');
    if (replaced(name, ' ', '-') == right) return named.kind;
    names += (names.empty() ? "" : ", ") + right;
  }
  throw InputError(source, "is '" + name + "', must be one of " + names);
}

bool has_truth(TrialKind kind) {
  return kind == TrialKind::kStart || kind == TrialKind::kFarStart || kind == TrialKind::kHalfTurn;
}

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
  require_each_once(kinds, source, "kinds", kind_name);
  require_each_once(seeds, source, "seeds",
                    [](std::uint32_t seed) { return std::to_string(seed); });
}

std::vector<Trial> plan_trials(const std::vector<StudyCase>& cases, const StudyOptions& options) {
  options.validate();
  require_cases(cases, options.kinds);
  std::vector<Trial> trials;
  for (std::size_t own = 0; own < cases.size(); ++own) {
    if (cases[own].is_stranger) continue;
    for (const TrialKind kind : options.kinds)
      for (const std::uint32_t seed : options.seeds) {
        const Planner planner(cases, own, kind, seed, options);
        for (int index = 0; index < options.starts; ++index) trials.push_back(planner.trial(index));
      }
  }
  return trials;
}

PreScanVolume trial_ultrasound(const StudyCase& own, const Trial& trial) {
  const PreScanVolume& ultrasound = own.ultrasound;
  switch (trial.kind) {
    case TrialKind::kMirrored:
      return lines_reversed(ultrasound);
    case TrialKind::kFramesReversed:
      return frames_reversed(ultrasound);
    case TrialKind::kHalfTurn:
      return frames_reversed(lines_reversed(ultrasound));
    case TrialKind::kNoise:
      return speckle_only(ultrasound, trial.seed);
    default:
      return ultrasound;
  }
}

std::optional<CtVolume> altered_ct(const StudyCase& ct_case, const Trial& trial) {
  if (trial.kind == TrialKind::kCtMirrored) return mirrored_ct(ct_case.ct, ct_case.centre_ct_mm());
  if (trial.kind == TrialKind::kCtAxesSwapped)
    return axes_swapped_ct(ct_case.ct, ct_case.centre_ct_mm());
  return std::nullopt;
}

Isometry3d T_shown_us(const StudyCase& own, const Trial& trial) {
  if (trial.kind != TrialKind::kHalfTurn) return Isometry3d::Identity();
  return half_turn(own.ultrasound.geometry);
}

}  // namespace usct
