#include "registration/attempts/attempt.h"

#include "registration/search/refinement.h"

namespace usct::registration {

Attempt attempt_on(const ImagePyramid& images, const RegistrationInput& input, Run& run) {
  std::vector<LevelSimilarities> similarities;
  for (const Level& level : images.levels)
    similarities.push_back({level.similarity.get(), level.screening.get()});
  return {input,
          images,
          {std::move(similarities), input.options.search, input.T_us_ct_initial,
           images.prepared.field, input.options.seed},
          run};
}

std::vector<Candidate> searched(const Attempt& attempt, int round, std::vector<Candidate> found) {
  return attempt.run.timed(
      "search", [&] { return multi_start(attempt.problem, round, std::move(found), attempt.run); });
}

Outcome<Candidate> refined(const Attempt& attempt, const Candidate& optimum) {
  return refine(attempt.images, attempt.input.ct, optimum, attempt.input.options, attempt.run);
}

std::optional<Candidate> optimum_from(const Attempt& attempt, const Eigen::Isometry3d& T_us_ct) {
  const double reach_mm = attempt.input.options.confidence.rival_mm;
  const Candidate reached = attempt.run.timed(
      "search", [&] { return optimum_near(attempt.problem, T_us_ct, reach_mm, attempt.run); });
  if (!reached.has_value()) return std::nullopt;
  return reached;
}

void measure_pose(const Attempt& attempt, const Candidate& optimum, const Candidate& refined,
                  Measures& measures) {
  const SearchProblem& problem = attempt.problem;
  measures.overlap = refined.overlap;
  measures.displacement_mm = problem.field.distance_mm(refined.T_us_ct, problem.T_us_ct_initial);
  measures.disagreement_mm = problem.field.distance_mm(refined.T_us_ct, optimum.T_us_ct);
}

Refusal nothing_in_reach() {
  return {RegistrationStatus::kNoOverlap, "no pose in reach has CT and ultrasound overlap"};
}

}  // namespace usct::registration
