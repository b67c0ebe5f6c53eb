#include "registration/decoys.h"

#include <algorithm>
#include <deque>

#include "us_ct_registration/geometry/angles.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Whether the starts turn so far that half a turn is a pose like others, and no decoy.
bool reaches_half_turn(const SearchOptions& search) {
  return search.starts && search.starts->rotation_rad > 0.5 * kPi;
}

}  // namespace

SearchOptions decoy_search(const SearchOptions& search, const DecoyOptions& options) {
  SearchOptions decoy = search;
  for (LevelOptions& level : decoy.levels) {
    double& tolerance = level.optimizer.step_tolerance;
    // An optimizer's tolerance must stay below its first step.
    tolerance = std::max(tolerance, std::min(options.tolerance_factor * tolerance,
                                             0.5 * level.optimizer.initial_step));
  }
  LevelOptions& deciding = decoy.levels.back();
  deciding.optimised = std::min(deciding.optimised, options.optimised);
  return decoy;
}

Isometry3d mirror_of(Mirror mirror, const BeamGrid& beams, const Vector3d& centre_us_mm) {
  const FieldAxes axes = field_axes(beams);
  Matrix3d linear = Matrix3d::Identity();
  if (mirror != Mirror::kFrames) linear -= 2.0 * axes.lateral * axes.lateral.transpose();
  if (mirror != Mirror::kLines) linear -= 2.0 * axes.elevation * axes.elevation.transpose();
  Isometry3d motion = Isometry3d::Identity();
  motion.linear() = linear;
  motion.translation() = centre_us_mm - linear * centre_us_mm;
  return motion;
}

void MirroredSimilarity::evaluate(const SimilarityPose* poses, std::size_t count,
                                  SimilarityValue* values, const Check& check) const {
  std::vector<SimilarityPose> moved;
  moved.reserve(count);
  for (std::size_t i = 0; i < count; ++i) moved.push_back(mirrored(poses[i]));
  original_.evaluate(moved.data(), count, values, check);
}

std::optional<SimilarityDerivatives> MirroredSimilarity::derivatives(const SimilarityPose& pose,
                                                                     DerivativeOrder order) const {
  std::optional<SimilarityDerivatives> result = original_.derivatives(mirrored(pose), order);
  if (!result) return result;
  // A sample q of the original lies at p = L q + s. A motion w x p + t of p moves q by
  // L^T (w x (L q + s) + t) = det(L) (L^T w) x q + L^T (w x s + t).
  const Matrix3d back = mirror_.linear().transpose();
  const Vector3d s = mirror_.translation();
  Matrix3d cross;  // [s]x
  cross << 0.0, -s.z(), s.y(), s.z(), 0.0, -s.x(), -s.y(), s.x(), 0.0;
  SimilarityDerivatives::Matrix changes = SimilarityDerivatives::Matrix::Identity();
  changes.block<3, 3>(0, 0) = back.determinant() * back;
  changes.block<3, 3>(3, 0) = -back * cross;
  changes.block<3, 3>(3, 3) = back;
  result->gradient = (changes.transpose() * result->gradient).eval();
  result->curvature = (changes.transpose() * result->curvature * changes).eval();
  return result;
}

std::vector<Decoy> search_decoys(const SearchProblem& problem,
                                 const Eigen::Isometry3d& T_us_ct_found, const BeamGrid& beams,
                                 const DecoyOptions& options, int rounds, Run& run) {
  const SearchOptions search = decoy_search(problem.options, options);
  const Vector3d centre = problem.field.centre_us_mm();
  std::vector<Decoy> decoys;
  for (const auto& [mirror, name] : words_of(Mirror{})) {
    if (mirror == Mirror::kHalfTurn && reaches_half_turn(problem.options)) continue;
    const Isometry3d motion = mirror_of(mirror, beams, centre);
    std::deque<MirroredSimilarity> mirrored;  // does not move its elements
    const auto mirror_image = [&](const Similarity* similarity) -> const Similarity* {
      return similarity == nullptr ? nullptr : &mirrored.emplace_back(*similarity, motion);
    };
    std::vector<LevelSimilarities> similarities;
    for (const LevelSimilarities& level : problem.similarities)
      similarities.push_back({mirror_image(level.all), mirror_image(level.screening)});
    // A nearly symmetric anatomy explains mirrored ultrasound at a pose near the found one.
    const SearchProblem decoy{similarities,  search,       problem.T_us_ct_initial,
                              problem.field, problem.seed, T_us_ct_found};
    std::vector<Candidate> optima;
    for (int round = 0; round < rounds; ++round)
      optima = multi_start(decoy, round, std::move(optima), run);
    if (!optima.empty()) decoys.push_back({mirror, motion, optima.front()});
  }
  return decoys;
}

}  // namespace usct::registration
