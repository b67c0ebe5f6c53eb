#include "registration/attempts/attempt.h"

namespace usct::registration {

SearchProblem problem_of(const RegistrationInput& input, const ImagePyramid& images) {
  std::vector<LevelSimilarities> similarities;
  for (const Level& level : images.levels)
    similarities.push_back({level.similarity.get(), level.screening.get()});
  return {std::move(similarities), input.options.search, input.T_us_ct_initial,
          images.prepared.field, input.options.seed};
}

std::vector<Candidate> searched(const Attempt& attempt, int round, std::vector<Candidate> found) {
  return attempt.run.timed(
      "search", [&] { return multi_start(attempt.problem, round, std::move(found), attempt.run); });
}

Refusal nothing_in_reach() {
  return {RegistrationStatus::kNoOverlap, "no pose in reach has CT and ultrasound overlap"};
}

}  // namespace usct::registration
