#pragma once

#include <memory>
#include <optional>

#include "registration/images/image_pyramid.h"
#include "registration/input.h"
#include "registration/search/block_matching.h"
#include "registration/search/multi_start.h"

namespace usct::registration {

/// A search whose starts are matched blocks, and which climbs by local LC2 in patches nearly as
/// large. The joint correlation ratio asks for one function of the CT that explains the ultrasound
/// everywhere; where contrast is low, chance makes others as good, and the right pose is not the
/// best of those that are climbed to. Patches have a function each, and stand together.
class BlockSearch {
 public:
  /// The images must outlive it.
  BlockSearch(const RegistrationInput& input, const ImagePyramid& images,
              std::shared_ptr<const Similarity> similarity);

  const SearchProblem& problem() const { return problem_; }

 private:
  const SearchOptions options_;
  const std::shared_ptr<const Similarity> similarity_;
  const BlockMatching matching_;
  const SearchProblem problem_;
};

/// Null where the search has no starts, where its region or the field of view is larger than blocks
/// are matched in, where its similarities need no packed CT, and where no patch of the ultrasound
/// has structure.
std::unique_ptr<const BlockSearch> block_search(const RegistrationInput& input,
                                                const ImagePyramid& images);

}  // namespace usct::registration
