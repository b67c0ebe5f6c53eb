#include "registration/attempts/trail.h"

#include <algorithm>

namespace usct::registration {
namespace {

using Eigen::Isometry3d;

/// Climbs from poses that are closer than this end alike: it is half a voxel of the deciding level.
constexpr double kSameStartMm = 1.0;

/// The decoys of the trail on new images, as far as they have a value there.
std::vector<Decoy> follow_decoys(const std::vector<Decoy>& before, const Isometry3d& T_now_before,
                                 const Isometry3d& T_us_ct, const SearchProblem& problem,
                                 const BeamGrid& beams, const Climb& how, Run& run) {
  std::vector<Isometry3d> mirrors;
  std::vector<MirroredSimilarity> similarities;
  std::vector<std::vector<Candidate>> candidates;
  for (const Decoy& decoy : before) {
    const Isometry3d T_mirror = mirror_of(decoy.mirror, beams, problem.field.centre_us_mm());
    mirrors.push_back(T_mirror);
    similarities.emplace_back(*problem.similarities.back().all, T_mirror);
    // The mirrored ultrasound stays where it was in the CT, whatever the field is mirrored about.
    const Isometry3d T_ct_us =
        decoy.best.T_us_ct.inverse() * decoy.T_mirror * T_now_before.inverse() * T_mirror.inverse();
    // If the ultrasound itself is mirrored now, its decoy fits where the ultrasound did before.
    candidates.push_back({{T_ct_us.inverse(), {}}, {T_us_ct, {}}});
    if (problem.field.are_apart(T_us_ct, problem.T_us_ct_initial, kSameStartMm))
      candidates.back().push_back({problem.T_us_ct_initial, {}});
  }
  std::vector<Climbers> climbers;
  for (std::size_t i = 0; i < before.size(); ++i)
    climbers.push_back({similarities[i], candidates[i]});
  climb(climbers, how, problem.field, run);
  std::vector<Decoy> decoys;
  for (std::size_t i = 0; i < before.size(); ++i) {
    sort_best_first(candidates[i], 1);
    if (candidates[i].front().has_value())
      decoys.push_back({before[i].mirror, mirrors[i], candidates[i].front(), {}});
  }
  return decoys;
}

}  // namespace

std::optional<Followed> follow(const Trail& trail, const SearchProblem& problem,
                               const BeamGrid& beams, const ConfidenceOptions& confidence,
                               Run& run) {
  const Similarity& similarity = *problem.similarities.back().all;
  const Isometry3d T_now_before = problem.T_us_ct_initial * trail.T_us_ct.inverse();
  const OptimizerOptions& optimizer = problem.options.levels.back().optimizer;
  const double reach_mm = std::max(confidence.rival_mm, 2.0 * optimizer.step_tolerance);
  std::vector<Candidate> optima{{problem.T_us_ct_initial, {}}};
  for (const Candidate& rival : trail.rivals) optima.push_back({T_now_before * rival.T_us_ct, {}});
  const Climb how{optimizer, reach_mm, {}, problem.seed};
  climb(similarity, how, problem.field, optima, run);
  const Candidate tracked = optima.front();
  const bool is_beaten = std::any_of(optima.begin(), optima.end(), [&](const Candidate& other) {
    return other.value > tracked.value &&
           problem.field.are_apart(other.T_us_ct, tracked.T_us_ct, confidence.rival_mm);
  });
  if (is_beaten || !tracked.has_value()) return std::nullopt;
  optima.erase(optima.begin());
  sort_best_first(optima, optima.size());
  optima.insert(optima.begin(), tracked);

  std::vector<Decoy> decoys =
      follow_decoys(trail.decoys, T_now_before, tracked.T_us_ct, problem, beams, how, run);
  return Followed{std::move(optima), std::move(decoys)};
}

}  // namespace usct::registration
