#include "registration/search/block_search.h"

#include "us_ct_registration/similarity/catalogue.h"

namespace usct::registration {
namespace {

/// One round on the deciding level, which climbs from all poses of matched blocks.
SearchOptions options_of(SearchOptions search, const ConfidenceOptions& confidence) {
  constexpr int kMatches = 8;
  LevelOptions level = search.levels.back();
  // The optimizer of the level may need derivatives, which this similarity may lack.
  level.optimizer.method = confidence.parts.optimizer.method;
  level.screened.reset();
  level.optimised = level.kept = kMatches;
  search.levels = {level};
  search.rounds = 1;
  return search;
}

/// Patches of 12 mm lead to an optimum from farther away than those of the evidence do.
SimilarityOptions similarity_of(const ConfidenceOptions& confidence) {
  constexpr double kPatchMm = 12.0;
  SimilarityOptions similarity = confidence.similarity;
  if (auto* const lc2 = std::get_if<LocalLc2Options>(&similarity))
    lc2->patches.depth_mm = lc2->patches.lateral_mm = lc2->patches.elevation_mm = kPatchMm;
  return similarity;
}

}  // namespace

BlockSearch::BlockSearch(const RegistrationInput& input, const ImagePyramid& images,
                         std::shared_ptr<const Similarity> similarity)
    : options_(options_of(input.options.search, input.options.confidence)),
      similarity_(std::move(similarity)),
      matching_(images.prepared.us, images.levels.back().images->packed_ct(),
                *input.options.search.starts),
      problem_{{{similarity_.get(), nullptr}},
               options_,
               input.T_us_ct_initial,
               images.prepared.field,
               input.options.seed,
               input.T_us_ct_initial,
               {},
               &matching_} {}

std::unique_ptr<const BlockSearch> block_search(const RegistrationInput& input,
                                                const ImagePyramid& images) {
  const SearchOptions& search = input.options.search;
  if (!search.starts || !BlockMatching::covers(*search.starts) ||
      !BlockMatching::covers(*images.prepared.us))
    return nullptr;
  for (const LevelOptions& level : search.levels)
    if (needs_of(level.similarity).recorded_ct) return nullptr;
  std::shared_ptr<const Similarity> similarity =
      make_similarity(*images.levels.back().images, similarity_of(input.options.confidence));
  if (!similarity) return nullptr;
  return std::make_unique<const BlockSearch>(input, images, std::move(similarity));
}

}  // namespace usct::registration
