#include "registration/images/image_pyramid.h"

#include <algorithm>
#include <cmath>

#include "geometry/point_spread.h"
#include "registration/evidence_plan.h"
#include "registration/images/ct_averages.h"
#include "ultrasound/resting_frames.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct::registration {
namespace {

using Eigen::Vector3i;

/// Fewest points that define the six parameters of a pose.
constexpr std::size_t kLeastPoints = 100;
/// Fewest voxels along each axis: a cell of the packed CT and one voxel more on either side.
constexpr int kLeastVoxels = 4;

/// Why a part of the CT of this size does not suffice.
std::string words_for_little_ct(const Eigen::Vector3i& size) {
  if (size.minCoeff() <= 0)
    return "the CT lies nowhere near the ultrasound at the initial pose: check that pose, its "
           "direction (it may be inverted), and that no files of CT and ultrasound are exchanged";
  return "of the CT, only " + std::to_string(size.x()) + " x " + std::to_string(size.y()) + " x " +
         std::to_string(size.z()) +
         " voxels lie in reach of the ultrasound at the initial pose, must be >= " +
         std::to_string(kLeastVoxels) + " along each axis";
}

std::string words_for_few_samples(std::size_t count) {
  if (count == 0) return "nothing in the ultrasound counts: it is constant, or all of it is masked";
  return "only " + std::to_string(count) + " samples of the ultrasound count, must be " +
         std::to_string(kLeastPoints) + " at least: nearly all of it is constant or masked";
}

bool needs_recorded_ct(const ClimbOptions& level) { return needs_of(level.similarity).recorded_ct; }

/// Beams cost memory and time. Positions suffice unless a similarity uses the direction of the
/// beams.
bool needs_beams(const RegistrationOptions& options) {
  const auto along = [](const SimilarityOptions& similarity) { return needs_of(similarity).beams; };
  const std::optional<RefinementOptions>& refinement = options.refinement;
  return along(options.confidence.similarity) || along(options.confidence.ridge_similarity) ||
         std::any_of(options.search.levels.begin(), options.search.levels.end(),
                     [&](const LevelOptions& level) { return along(level.similarity); }) ||
         (refinement && along(refinement->similarity));
}

/// `packed` is null if the similarity uses the recorded CT.
std::shared_ptr<SimilarityImages> images_of(const ClimbOptions& level,
                                            const PreparedUltrasound& prepared,
                                            const CtInReach& in_reach,
                                            std::shared_ptr<const PackedCt> packed,
                                            const RegistrationOptions& options) {
  std::optional<BeamUltrasound> coarse = averaged_to(*prepared.us, level.spacing_mm);
  // Made here by all threads. A climb would make it in one of them, while the others wait.
  if (packed && level.optimizer.method == OptimizerMethod::kGaussNewton) packed->gradient();
  return std::make_shared<SimilarityImages>(
      coarse ? std::make_shared<const BeamUltrasound>(std::move(*coarse)) : prepared.us,
      std::move(packed),
      needs_recorded_ct(level)
          ? std::make_shared<const CtVolume>(crop(in_reach.ct, in_reach.region))
          : nullptr,
      needs_beams(options));
}

/// The similarity of a level of the search. In a field of view larger than `kMostMm3` it takes half
/// or a quarter of the samples: the most that fill no more than that volume at the level's spacing.
SimilarityOptions similarity_of(const LevelOptions& level, const BeamUltrasound& us) {
  // The largest of the usual fields of a kidney. More samples take longer, and find the same pose.
  constexpr double kMostMm3 = 1.2e6;
  if (!level.spacing_mm) return level.similarity;
  const double most = kMostMm3 / std::pow(*level.spacing_mm, 3);
  const auto known = static_cast<double>(std::count(us.known.begin(), us.known.end(), 1));
  return on_samples(level.similarity, known <= most         ? SampleSubset::kAll
                                      : known <= 2.0 * most ? SampleSubset::kHalf
                                                            : SampleSubset::kQuarter);
}

/// A similarity on the images, or the reason why there is none.
Outcome<Level> level_on(std::shared_ptr<SimilarityImages> images,
                        const SimilarityOptions& similarity) {
  Level level{std::move(images), nullptr, nullptr};
  level.similarity = make_similarity(*level.images, similarity);
  if (!level.similarity)
    return Refusal{RegistrationStatus::kFailed,
                   "the ultrasound has no patch with structure, must have one at least"};
  return level;
}

bool are_parallel(const BeamGrid& beams) {
  return std::all_of(beams.beams.begin(), beams.beams.end(), [&](const Beam& beam) {
    return beam.direction.isApprox(beams.beams.front().direction);
  });
}

void require_valid(const BeamUltrasound& ultrasound, const CtVolume& ct,
                   const Eigen::Isometry3d& T_us_ct_initial, const RegistrationOptions& options) {
  ultrasound.validate();
  options.validate();
  ultrasound.beams.validate();
  ct.validate("CT");
  if (options.beams == BeamKind::kParallel && !are_parallel(ultrasound.beams))
    throw InputError("ultrasound",
                     "has beams that are not parallel, but the options are for parallel beams "
                     "('beams: parallel', preset thesis_a): scan-convert it first (usct register "
                     "--parallel-beams)");
  if (T_us_ct_initial.matrix().allFinite()) require_rigid(T_us_ct_initial, "T_us_ct_initial");
}

/// The reason why no pose could ever be found, if there is one.
std::optional<Refusal> hopeless(const Eigen::Isometry3d& T_us_ct_initial,
                                const RegistrationOptions& options) {
  if (!T_us_ct_initial.matrix().allFinite())
    return Refusal{RegistrationStatus::kFailed, "the initial pose is not finite"};
  const auto unable = [](const std::string& climb) {
    return Refusal{RegistrationStatus::kFailed,
                   climb + ".optimizer.max_evaluations is 0: no pose can be tried"};
  };
  const std::vector<LevelOptions>& levels = options.search.levels;
  for (std::size_t i = 0; i < levels.size(); ++i)
    if (levels[i].optimizer.max_evaluations == 0)
      return unable("search.levels[" + std::to_string(i) + "]");
  if (options.refinement && options.refinement->optimizer.max_evaluations == 0)
    return unable("refinement");
  return std::nullopt;
}

/// The reason why the ultrasound shows no pose, if there is one.
std::optional<Refusal> unusable(const FieldPoints& field, const BeamGrid& beams,
                                const RegistrationOptions& options) {
  const auto failed = [](const std::string& why) {
    return Refusal{RegistrationStatus::kFailed, why};
  };
  if (const std::size_t count = field.us_mm().size(); count < kLeastPoints)
    return failed(words_for_few_samples(count));
  if (lie_on_a_line(field.us_mm()))
    return failed("what counts in the ultrasound lies on one line: no rotation about it shows");
  if (EvidencePlan(options.confidence).gathers() && std::min(beams.frames, beams.lines) < 2)
    return failed(std::string("the ultrasound has one ") + (beams.frames < 2 ? "frame" : "line") +
                  " in another place than the others, must have two at least: its halves must "
                  "agree about a pose for it to be believed");
  return std::nullopt;
}

/// Adds the levels of the search, or says why there can be none.
std::optional<Refusal> add_levels(const PreparedCt& ct, const RegistrationOptions& options,
                                  ImagePyramid& pyramid, Run& run) {
  const std::vector<LevelOptions>& levels = options.search.levels;
  const std::vector<std::shared_ptr<const PackedCt>> cts =
      packed_cts(ct, pyramid.in_reach.region, steps_of(levels, ct.ct().grid), options, run.check());
  for (std::size_t i = 0; i < levels.size(); ++i) {
    run.check_cancelled();
    std::shared_ptr<SimilarityImages> of_level =
        images_of(levels[i], pyramid.prepared, pyramid.in_reach, cts[i], options);
    const SimilarityOptions similarity = similarity_of(levels[i], of_level->ultrasound());
    Outcome<Level> level = level_on(std::move(of_level), similarity);
    if (!level) return level.refusal();
    if (levels[i].screened)
      level->screening =
          make_similarity(*level->images, on_samples(similarity, SampleSubset::kQuarter));
    pyramid.levels.push_back(std::move(*level));
  }
  return std::nullopt;
}

bool same_images(const ClimbOptions& a, const ClimbOptions& b) {
  return a.spacing_mm == b.spacing_mm && !needs_recorded_ct(a) && !needs_recorded_ct(b);
}

}  // namespace

Outcome<ImagePyramid> prepare(const RegistrationInput& input, Run& run) {
  const auto& [recorded, ct, T_us_ct_initial, options] = input;
  require_valid(recorded, ct.ct(), T_us_ct_initial, options);
  if (std::optional<Refusal> refusal = hopeless(T_us_ct_initial, options)) return *refusal;
  std::optional<BeamUltrasound> moving;
  PreparedUltrasound prepared = run.timed("ultrasound", [&] {
    moving = without_resting_frames(recorded);
    return prepare_ultrasound(moving ? *moving : recorded, options, run.check());
  });
  const BeamGrid& beams = moving ? moving->beams : recorded.beams;
  if (std::optional<Refusal> refusal = unusable(prepared.field, beams, options)) return *refusal;
  run.report(0.5);
  return run.timed("ct", [&]() -> Outcome<ImagePyramid> {
    ImagePyramid pyramid{
        std::move(prepared), ct_in_reach(ct.ct(), beams, T_us_ct_initial, options.search), {}};
    if (const Eigen::Vector3i& size = pyramid.in_reach.region.size; size.minCoeff() < kLeastVoxels)
      return Refusal{RegistrationStatus::kNoOverlap, words_for_little_ct(size)};
    if (std::optional<Refusal> refusal = add_levels(ct, options, pyramid, run)) return *refusal;
    return pyramid;
  });
}

Outcome<Level> refinement_level(const ImagePyramid& images, const PreparedCt& ct,
                                const Eigen::Isometry3d& T_us_ct,
                                const RegistrationOptions& options) {
  const RefinementOptions& refinement = *options.refinement;
  if (same_images(refinement, options.search.levels.back()))
    return level_on(images.levels.back().images, refinement.similarity);
  // A similarity that simulates ultrasound needs the whole beam, from the probe to the sample.
  if (needs_recorded_ct(refinement))
    return level_on(images_of(refinement, images.prepared, images.in_reach, nullptr, options),
                    refinement.similarity);
  const double margin_mm = std::min(refinement.ct_margin_mm, refinement.reach_mm);
  const CtInReach near = ct_around(ct.ct(), images.prepared, T_us_ct, margin_mm);
  if (near.region.size.minCoeff() < kLeastVoxels)
    return Refusal{RegistrationStatus::kNoOverlap, "CT and ultrasound do not overlap"};
  const AveragingSteps steps = steps_to(refinement.spacing_mm, ct.ct().grid);
  return level_on(images_of(refinement, images.prepared, near,
                            packed_cts(ct, near.region, {steps}, options).front(), options),
                  refinement.similarity);
}

}  // namespace usct::registration
