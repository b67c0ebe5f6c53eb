#include "registration/evidence/decoys.h"

#include <algorithm>
#include <deque>

#include "registration/motion_about.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Whether the starts turn so far that half a turn is a pose like others, and no decoy.
bool reaches_half_turn(const SearchOptions& search) {
  return search.starts && search.starts->rotation_rad > 0.5 * kPi;
}

/// Whether all mirror images are one: at all orientations, as far as blocks are matched there,
/// every reflection is any other one, turned.
bool have_one_mirror_image(const SearchProblem& problem) {
  const std::optional<StartOptions>& starts = problem.options.starts;
  return problem.blocks != nullptr && starts && starts->region == StartRegion::kBall &&
         starts->rotation_rad > 0.99 * kPi;
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

/// The middle of a kidney lies up to so far from that of the field: mirrored in a plane through its
/// own middle, it lies up to twice as far beside where the search would look for it.
constexpr double kMiddleOfAnatomyMm = 10.0;

/// Mirrored CTs share the climbs of so many searches.
constexpr int kMirroredCtSearches = 2;

/// Translations along the normal of the plane in which a CT is mirrored.
std::vector<Vector3d> along_normal(const Isometry3d& T_mirror) {
  const Matrix3d projection = Matrix3d::Identity() - T_mirror.linear();  // 2 n n^T
  Matrix3d::Index axis = 0;
  projection.diagonal().maxCoeff(&axis);
  const Vector3d shift = 2.0 * kMiddleOfAnatomyMm * projection.col(axis).normalized();
  return {shift, -shift};
}

/// The translation to where ultrasound lies that was recorded in reverse order, from where it lies
/// mirrored about the centre of what counts of it; none where the starts reach it anyway.
std::vector<Vector3d> to_recorded_mirror(Mirror mirror, const BeamGrid& beams,
                                         const Vector3d& centre_us_mm) {
  constexpr double kReachedAnywayMm = 5.0;
  const Vector3d shift = mirror_of(mirror, beams, centre_us_mm).translation() -
                         mirror_of(mirror, beams, beams.middle_mm()).translation();
  if (shift.norm() <= kReachedAnywayMm) return {};
  return {shift};
}

/// The mirrored similarities of decoys, and the problems of searching with them.
class DecoyProblems {
 public:
  /// The similarities, options and field of `problem` must outlive the object.
  DecoyProblems(const std::vector<Decoy>& decoys, const SearchProblem& problem,
                const Isometry3d& T_us_ct_found) {
    for (const Decoy& decoy : decoys) {
      const auto mirror_image = [&](const Similarity* similarity) -> const Similarity* {
        return similarity == nullptr ? nullptr
                                     : &mirrored_.emplace_back(*similarity, decoy.T_mirror);
      };
      std::vector<LevelSimilarities> similarities;
      for (const LevelSimilarities& level : problem.similarities)
        similarities.push_back({mirror_image(level.all), mirror_image(level.screening)});
      // A nearly symmetric anatomy explains mirrored ultrasound at a pose near the found one.
      all_.push_back({std::move(similarities), problem.options, problem.T_us_ct_initial,
                      problem.field, problem.seed, T_us_ct_found, decoy.start_shifts_us_mm,
                      problem.blocks, decoy.T_mirror});
    }
  }
  const std::vector<SearchProblem>& all() const { return all_; }

 private:
  std::deque<MirroredSimilarity> mirrored_;  // does not move its elements
  std::vector<SearchProblem> all_;
};

/// Adds what is reached from a pose that was found for the ultrasound since.
void climb_from(const Isometry3d& T_us_ct_found, const std::vector<SearchProblem>& problems,
                std::vector<Decoy>& decoys, Run& run) {
  const double reach_mm = problems.front().options.levels.back().reach_mm;
  const std::vector<Candidate> near = optima_near(problems, T_us_ct_found, reach_mm, run);
  for (std::size_t i = 0; i < decoys.size(); ++i) {
    if (near[i].has_value()) decoys[i].optima.push_back(near[i]);
    sort_best_first(decoys[i].optima, decoys[i].optima.size());
  }
}

}  // namespace

bool lacks_a_side(const std::vector<Decoy>& decoys) {
  return std::any_of(decoys.begin(), decoys.end(), [](const Decoy& decoy) {
    return !is_of_ct(decoy.mirror) && !decoy.start_shifts_us_mm.empty();
  });
}

bool is_of_ct(Mirror mirror) {
  return mirror != Mirror::kLines && mirror != Mirror::kFrames && mirror != Mirror::kHalfTurn;
}

Isometry3d mirror_of(Mirror mirror, const BeamGrid& beams, const Vector3d& centre_us_mm) {
  const FieldAxes axes = field_axes(beams);
  Matrix3d linear = Matrix3d::Identity();
  if (mirror != Mirror::kFrames) linear -= 2.0 * axes.lateral * axes.lateral.transpose();
  if (mirror != Mirror::kLines) linear -= 2.0 * axes.elevation * axes.elevation.transpose();
  return motion_about(centre_us_mm, linear);
}

Isometry3d ct_mirror_of(Mirror mirror, const Matrix3d& axes, const Isometry3d& T_us_ct,
                        const Vector3d& centre_us_mm) {
  const Vector3d normal = T_us_ct.linear() * mirror_normal(mirror, axes);
  return motion_about(centre_us_mm, Matrix3d::Identity() - 2.0 * normal * normal.transpose());
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
  SimilarityDerivatives::Matrix changes = SimilarityDerivatives::Matrix::Identity();
  changes.block<3, 3>(0, 0) = back.determinant() * back;
  changes.block<3, 3>(3, 0) = -back * cross_matrix(mirror_.translation());
  changes.block<3, 3>(3, 3) = back;
  result->gradient = (changes.transpose() * result->gradient).eval();
  result->curvature = (changes.transpose() * result->curvature * changes).eval();
  return result;
}

std::vector<Decoy> searched_further(std::vector<Decoy> decoys, const SearchProblem& problem,
                                    const Isometry3d& T_us_ct_found, int rounds, Run& run) {
  if (decoys.empty()) return decoys;
  const DecoyProblems problems(decoys, problem, T_us_ct_found);
  // All decoys have gone through as many rounds.
  int& round = decoys.front().rounds;
  if (round > 0) climb_from(T_us_ct_found, problems.all(), decoys, run);
  std::vector<std::vector<Candidate>> optima;
  for (Decoy& decoy : decoys) optima.push_back(std::move(decoy.optima));
  std::optional<int> competing_for;
  if (is_of_ct(decoys.front().mirror)) competing_for = kMirroredCtSearches;
  for (; round < rounds; ++round)
    optima = multi_start(problems.all(), round, std::move(optima), run, competing_for);
  for (std::size_t i = 0; i < decoys.size(); ++i) {
    decoys[i].rounds = round;
    decoys[i].optima = std::move(optima[i]);
    decoys[i].best = decoys[i].optima.empty() ? Candidate{} : decoys[i].optima.front();
  }
  decoys.erase(std::remove_if(decoys.begin(), decoys.end(),
                              [](const Decoy& decoy) { return !decoy.best.has_value(); }),
               decoys.end());
  return decoys;
}

std::vector<Decoy> search_decoys(const SearchProblem& problem,
                                 const Eigen::Isometry3d& T_us_ct_found, const BeamGrid& beams,
                                 int rounds, Run& run) {
  const Vector3d& centre = problem.field.centre_us_mm();
  std::vector<Decoy> decoys;
  for (const Mirror mirror : {Mirror::kLines, Mirror::kFrames, Mirror::kHalfTurn}) {
    if (mirror == Mirror::kHalfTurn && reaches_half_turn(problem.options)) continue;
    if (mirror != Mirror::kLines && have_one_mirror_image(problem)) continue;
    decoys.push_back({mirror,
                      mirror_of(mirror, beams, centre),
                      {},
                      {},
                      0,
                      to_recorded_mirror(mirror, beams, centre)});
  }
  return searched_further(std::move(decoys), problem, T_us_ct_found, rounds, run);
}

std::vector<Decoy> search_mirrored_ct(const SearchProblem& problem,
                                      const Eigen::Isometry3d& T_us_ct_found, const Matrix3d& axes,
                                      int rounds, Run& run) {
  if (have_one_mirror_image(problem)) return {};  // that of the ultrasound
  std::vector<Decoy> decoys;
  for (const Mirror mirror : {Mirror::kCtAxis1, Mirror::kCtAxis2, Mirror::kCtAxis3,
                              Mirror::kCtAxes12, Mirror::kCtAxes13, Mirror::kCtAxes23}) {
    const Isometry3d T_mirror =
        ct_mirror_of(mirror, axes, problem.T_us_ct_initial, problem.field.centre_us_mm());
    decoys.push_back({mirror, T_mirror, {}, {}, 0, along_normal(T_mirror)});
  }
  return searched_further(std::move(decoys), problem, T_us_ct_found, rounds, run);
}

}  // namespace usct::registration
