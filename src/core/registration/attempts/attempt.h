#pragma once

#include <vector>

#include "registration/images/image_pyramid.h"
#include "registration/input.h"
#include "registration/search/multi_start.h"

/// An attempt to register: one search on one set of images.
namespace usct::registration {

/// What the steps of an attempt work on. The objects that it refers to must outlive it.
struct Attempt {
  const RegistrationInput& input;
  /// Those that `prepare` makes of the input.
  const ImagePyramid& images;
  const SearchProblem& problem;
  Run& run;
};

/// The search that the options ask for, on images that `prepare` makes of the input.
SearchProblem problem_of(const RegistrationInput& input, const ImagePyramid& images);

/// The step search, as `multi_start`.
std::vector<Candidate> searched(const Attempt& attempt, int round, std::vector<Candidate> found);

/// The reason of an attempt whose search finds no pose with a value.
Refusal nothing_in_reach();

}  // namespace usct::registration
