#include "registration/decoys.h"

#include <algorithm>
#include <deque>

#include "parallel.h"
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

/// The motion of the field of view that applies a linear map about its centre.
Isometry3d about(const Vector3d& centre_us_mm, const Matrix3d& linear) {
  Isometry3d motion = Isometry3d::Identity();
  motion.linear() = linear;
  motion.translation() = centre_us_mm - linear * centre_us_mm;
  return motion;
}

/// The normal of the plane in which a mirrored CT is reflected, CT frame.
Vector3d mirror_normal(Mirror mirror, const Matrix3d& axes) {
  switch (mirror) {
    case Mirror::kCtAxis1:
      return axes.col(0);
    case Mirror::kCtAxis2:
      return axes.col(1);
    case Mirror::kCtAxis3:
      return axes.col(2);
    case Mirror::kCtAxes12:
      return (axes.col(0) - axes.col(1)).normalized();
    case Mirror::kCtAxes13:
      return (axes.col(0) - axes.col(2)).normalized();
    default:
      return (axes.col(1) - axes.col(2)).normalized();
  }
}

/// Searches with mirrored ultrasound from where the search ended, up to so many rounds. The best
/// has no value if there is none.
void search(Decoy& decoy, const SearchProblem& problem, const Isometry3d& T_us_ct_found, int rounds,
            Run& run) {
  std::deque<MirroredSimilarity> mirrored;  // does not move its elements
  const auto mirror_image = [&](const Similarity* similarity) -> const Similarity* {
    return similarity == nullptr ? nullptr : &mirrored.emplace_back(*similarity, decoy.T_mirror);
  };
  std::vector<LevelSimilarities> similarities;
  for (const LevelSimilarities& level : problem.similarities)
    similarities.push_back({mirror_image(level.all), mirror_image(level.screening)});
  // A nearly symmetric anatomy explains mirrored ultrasound at a pose near the found one.
  const SearchProblem of_decoy{similarities,  problem.options, problem.T_us_ct_initial,
                               problem.field, problem.seed,    T_us_ct_found};
  if (decoy.rounds > 0) {
    const Candidate near =
        optimum_near(of_decoy, T_us_ct_found, problem.options.levels.back().reach_mm, run);
    if (near.has_value()) decoy.optima.push_back(near);
    sort_best_first(decoy.optima, decoy.optima.size());
  }
  for (; decoy.rounds < rounds; ++decoy.rounds)
    decoy.optima = multi_start(of_decoy, decoy.rounds, std::move(decoy.optima), run);
  decoy.best = decoy.optima.empty() ? Candidate{} : decoy.optima.front();
}

}  // namespace

Isometry3d mirror_of(Mirror mirror, const BeamGrid& beams, const Vector3d& centre_us_mm) {
  const FieldAxes axes = field_axes(beams);
  Matrix3d linear = Matrix3d::Identity();
  if (mirror != Mirror::kFrames) linear -= 2.0 * axes.lateral * axes.lateral.transpose();
  if (mirror != Mirror::kLines) linear -= 2.0 * axes.elevation * axes.elevation.transpose();
  return about(centre_us_mm, linear);
}

Isometry3d ct_mirror_of(Mirror mirror, const Matrix3d& axes, const Isometry3d& T_us_ct,
                        const Vector3d& centre_us_mm) {
  const Vector3d normal = T_us_ct.linear() * mirror_normal(mirror, axes);
  return about(centre_us_mm, Matrix3d::Identity() - 2.0 * normal * normal.transpose());
}

void MirroredSimilarity::evaluate(const SimilarityPose* poses, std::size_t count,
                                  SimilarityValue* values, const Check& check) const {
  std::vector<SimilarityPose> moved;
  moved.reserve(count);
  for (std::size_t i = 0; i < count; ++i) moved.push_back(mirrored(poses[i]));
  original_.evaluate(moved.data(), count, values, check);
}

std::optional<SimilarityDerivatives> MirroredSimilarity::derivatives(const SimilarityPose& pose,
                                                                     DerivativeOrder order,
                                                                     double above) const {
  std::optional<SimilarityDerivatives> result = original_.derivatives(mirrored(pose), order, above);
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

std::vector<Decoy> searched_further(std::vector<Decoy> decoys, const SearchProblem& problem,
                                    const Isometry3d& T_us_ct_found, int rounds, Run& run) {
  parallel_for(static_cast<int>(decoys.size()), [&](int i) {
    search(decoys[static_cast<std::size_t>(i)], problem, T_us_ct_found, rounds, run);
  });
  decoys.erase(std::remove_if(decoys.begin(), decoys.end(),
                              [](const Decoy& decoy) { return !decoy.best.has_value(); }),
               decoys.end());
  return decoys;
}

std::vector<Decoy> search_decoys(const SearchProblem& problem,
                                 const Eigen::Isometry3d& T_us_ct_found, const BeamGrid& beams,
                                 int rounds, Run& run) {
  std::vector<Decoy> decoys;
  for (const Mirror mirror : {Mirror::kLines, Mirror::kFrames, Mirror::kHalfTurn}) {
    if (mirror == Mirror::kHalfTurn && reaches_half_turn(problem.options)) continue;
    decoys.push_back({mirror, mirror_of(mirror, beams, problem.field.centre_us_mm()), {}, {}});
  }
  return searched_further(std::move(decoys), problem, T_us_ct_found, rounds, run);
}

std::vector<Decoy> search_mirrored_ct(const SearchProblem& problem,
                                      const Eigen::Isometry3d& T_us_ct_found, const Matrix3d& axes,
                                      int rounds, Run& run) {
  std::vector<Decoy> decoys;
  for (const Mirror mirror : {Mirror::kCtAxis1, Mirror::kCtAxis2, Mirror::kCtAxis3,
                              Mirror::kCtAxes12, Mirror::kCtAxes13, Mirror::kCtAxes23})
    decoys.push_back(
        {mirror,
         ct_mirror_of(mirror, axes, problem.T_us_ct_initial, problem.field.centre_us_mm()),
         {},
         {}});
  return searched_further(std::move(decoys), problem, T_us_ct_found, rounds, run);
}

}  // namespace usct::registration
