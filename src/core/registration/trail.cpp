#include "registration/trail.h"

#include <algorithm>

namespace usct::registration {
namespace {

using Eigen::Isometry3d;

/// As many as the evidence compares a pose with.
constexpr std::size_t kRivals = 3;

/// Climbs from poses that are closer than this end alike: it is half a voxel of the deciding level.
constexpr double kSameStartMm = 1.0;

/// The decoy of the trail on new images; without a value if it has none there.
Decoy follow_decoy(const Decoy& before, const Isometry3d& T_now_before, const Isometry3d& T_us_ct,
                   const SearchProblem& problem, const BeamGrid& beams, const LevelOptions& level,
                   double reach_mm, Run& run) {
  const Isometry3d T_mirror = mirror_of(before.mirror, beams, problem.field.centre_us_mm());
  const MirroredSimilarity similarity(*problem.similarities.back().all, T_mirror);
  // The mirrored ultrasound stays where it was in the CT, whatever the field is mirrored about.
  const Isometry3d T_ct_us =
      before.best.T_us_ct.inverse() * before.T_mirror * T_now_before.inverse() * T_mirror.inverse();
  // If the ultrasound itself is mirrored now, its decoy fits where the ultrasound did before.
  std::vector<Candidate> candidates{{T_ct_us.inverse(), {}}, {T_us_ct, {}}};
  if (problem.field.distance_mm(T_us_ct, problem.T_us_ct_initial) > kSameStartMm)
    candidates.push_back({problem.T_us_ct_initial, {}});
  evaluate(similarity, candidates, run);
  climb(similarity, {level.optimizer, reach_mm, {}, problem.seed}, problem.field, candidates, run);
  sort_best_first(candidates, 1);
  return {before.mirror, T_mirror, candidates.front(), {}};
}

}  // namespace

Trail trail_of(const Candidate& refined, const std::vector<Decoy>& decoys,
               const std::vector<Candidate>& optima, double rival_mm, const FieldPoints& field) {
  Trail trail{refined.T_us_ct, decoys, {}};
  for (const Candidate& other : optima)
    if (trail.rivals.size() < kRivals &&
        field.distance_mm(other.T_us_ct, optima.front().T_us_ct) > rival_mm)
      trail.rivals.push_back(other);
  return trail;
}

std::optional<Followed> follow(const Trail& trail, const SearchProblem& problem,
                               const BeamGrid& beams, const ConfidenceOptions& confidence,
                               Run& run) {
  const Similarity& similarity = *problem.similarities.back().all;
  const Isometry3d T_now_before = problem.T_us_ct_initial * trail.T_us_ct.inverse();
  const double reach_mm = confidence.rival_mm;
  std::vector<Candidate> optima{{problem.T_us_ct_initial, {}}};
  for (const Candidate& rival : trail.rivals) optima.push_back({T_now_before * rival.T_us_ct, {}});
  evaluate(similarity, optima, run);
  const OptimizerOptions& optimizer = problem.options.levels.back().optimizer;
  climb(similarity, {optimizer, reach_mm, {}, problem.seed}, problem.field, optima, run);
  const Candidate tracked = optima.front();
  const bool is_beaten = std::any_of(optima.begin(), optima.end(), [&](const Candidate& other) {
    return other.value > tracked.value &&
           problem.field.distance_mm(other.T_us_ct, tracked.T_us_ct) > confidence.rival_mm;
  });
  if (is_beaten || !tracked.has_value()) return std::nullopt;
  optima.erase(optima.begin());
  sort_best_first(optima, optima.size());
  optima.insert(optima.begin(), tracked);

  Followed followed{std::move(optima), {}};
  for (const Decoy& before : trail.decoys) {
    const Decoy decoy = follow_decoy(before, T_now_before, tracked.T_us_ct, problem, beams,
                                     problem.options.levels.back(), reach_mm, run);
    if (decoy.best.has_value()) followed.decoys.push_back(decoy);
  }
  return followed;
}

}  // namespace usct::registration
