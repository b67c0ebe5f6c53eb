#pragma once

#include <vector>

#include "registration/images/image_pyramid.h"
#include "registration/input.h"
#include "registration/search/multi_start.h"

/// An attempt to register: one search on one set of images.
namespace usct::registration {

/// Everything that the steps of an attempt work on. What it refers to must outlive it.
struct Attempt {
  const RegistrationInput& input;
  /// Those that `prepare` makes of the input.
  const ImagePyramid& images;
  SearchProblem problem;
  Run& run;
};

/// An attempt by the search that the options ask for.
Attempt attempt_on(const ImagePyramid& images, const RegistrationInput& input, Run& run);

/// The step search, as `multi_start`.
std::vector<Candidate> searched(const Attempt& attempt, int round, std::vector<Candidate> found);

/// The step refine: climbs from an optimum of the search on finer images around it, as
/// RefinementOptions say. Without a refinement the optimum itself is returned. Refuses if CT and
/// ultrasound do not overlap.
Outcome<Candidate> refined(const Attempt& attempt, const Candidate& optimum);

/// The optimum of the deciding level that a pose leads to; none if it has no value.
std::optional<Candidate> optimum_from(const Attempt& attempt, const Eigen::Isometry3d& T_us_ct);

/// Completes the measures of a pose by those that need no evidence: the refinement led from
/// `optimum` to `refined`.
void measure_pose(const Attempt& attempt, const Candidate& optimum, const Candidate& refined,
                  Measures& measures);

/// The reason of an attempt whose search finds no pose with a value.
Refusal nothing_in_reach();

}  // namespace usct::registration
