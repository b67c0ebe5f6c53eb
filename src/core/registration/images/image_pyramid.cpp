#include "registration/images/image_pyramid.h"

#include <algorithm>
#include <cmath>

#include "registration/evidence_plan.h"
#include "registration/images/ct_averages.h"
#include "registration/spread.h"
#include "ultrasound/resting_frames.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"
#include "us_ct_registration/ultrasound/decimation.h"

namespace usct::registration {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// Approximate number of points that measure distances between poses; more would not change them.
constexpr std::size_t kPoints = 2000;
/// Fewest points that define the six parameters of a pose.
constexpr std::size_t kLeastPoints = 100;
/// Fewest voxels along each axis: a cell of the packed CT and one voxel more on either side.
constexpr int kLeastVoxels = 4;

/// `known` must be 1 at the samples that count, and 0 elsewhere.
std::vector<Vector3d> counting_points(const BeamUltrasound& us) {
  const auto counting = static_cast<std::size_t>(std::count(us.known.begin(), us.known.end(), 1));
  const std::size_t step = std::max<std::size_t>(1, counting / kPoints);
  std::vector<Vector3d> points;
  const auto samples = static_cast<std::size_t>(us.beams.samples());
  std::size_t to_skip = 0;  // counted down, since a remainder takes far longer
  for (std::size_t beam = 0; beam < us.beams.beams.size(); ++beam) {
    const std::uint8_t* known = us.known.data() + beam * samples;
    const auto of_beam = static_cast<std::size_t>(std::count(known, known + samples, 1));
    if (of_beam <= to_skip) {
      to_skip -= of_beam;
      continue;
    }
    const Beam& from = us.beams.beams[beam];
    for (std::size_t s = 0; s < samples; ++s) {
      if (known[s] == 0) continue;
      if (to_skip == 0)
        points.push_back(from.origin_mm +
                         us.beams.axial.depth_mm(static_cast<double>(s)) * from.direction);
      to_skip = to_skip == 0 ? step - 1 : to_skip - 1;
    }
  }
  return points;
}

/// First and last samples of lines that are spread over each frame: a probe may go there and back
/// any number of times, so that no choice of frames is sure to have all places.
std::vector<Vector3d> outline(const BeamGrid& beams) {
  constexpr int kSteps = 6;
  std::vector<Vector3d> points;
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l <= kSteps; ++l)
      for (const int s : {0, beams.samples() - 1})
        points.push_back(beams.point(f, l * (beams.lines - 1) / kSteps, s));
  return points;
}

/// Why a part of the CT of this size does not suffice.
std::string words_for_little_ct(const Eigen::Vector3i& size) {
  if (size.minCoeff() <= 0) return "the CT lies nowhere near the ultrasound at the initial pose";
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

/// Unset if the ultrasound has this spacing already.
std::optional<BeamUltrasound> averaged(const BeamUltrasound& us,
                                       const std::optional<double>& spacing_mm) {
  if (!spacing_mm) return std::nullopt;
  const Vector3i factors = factors_for_spacing(us.beams, *spacing_mm);
  if (factors == Vector3i::Ones()) return std::nullopt;
  return decimate(us, factors);
}

/// `packed` is null if the similarity uses the recorded CT.
std::shared_ptr<SimilarityImages> images_of(const ClimbOptions& level,
                                            const PreparedUltrasound& prepared,
                                            const CtInReach& in_reach,
                                            std::shared_ptr<const PackedCt> packed,
                                            const RegistrationOptions& options) {
  std::optional<BeamUltrasound> coarse = averaged(*prepared.us, level.spacing_mm);
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

bool same_images(const ClimbOptions& a, const ClimbOptions& b) {
  return a.spacing_mm == b.spacing_mm && !needs_recorded_ct(a) && !needs_recorded_ct(b);
}

}  // namespace

PreparedUltrasound prepare_ultrasound(const BeamUltrasound& ultrasound,
                                      const RegistrationOptions& options, const Check& check) {
  const std::optional<BeamUltrasound> coarse =
      averaged(ultrasound, options.conditioning_spacing_mm);
  const BeamUltrasound& input = coarse ? *coarse : ultrasound;
  ConditionedUltrasound conditioned = condition(input, options.conditioning, [&](double) {
    if (check) check();
  });
  auto us = std::make_shared<BeamUltrasound>();
  us->beams = input.beams;
  us->brightness = std::move(conditioned.samples);
  us->known = std::move(conditioned.reasons);
  for (std::uint8_t& known : us->known) known = known == 0 ? 1 : 0;
  FieldPoints field(counting_points(*us));
  return {std::move(us), std::move(field)};
}

CtInReach ct_in_reach(const CtVolume& ct, const BeamGrid& beams,
                      const Eigen::Isometry3d& T_us_ct_initial, const SearchOptions& options) {
  std::vector<Vector3d> points = outline(beams);
  double margin_mm = options.ct_margin_mm;
  if (const std::optional<StartOptions>& starts = options.starts) {
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& p : points) centre += p / static_cast<double>(points.size());
    double radius_mm = 0.0;
    for (const Vector3d& p : points) radius_mm = std::max(radius_mm, (p - centre).norm());
    margin_mm += starts->translation_mm +
                 radius_mm * std::min(options.ct_most_turn_rad, starts->rotation_rad);
  }
  for (Vector3d& p : points) p = T_us_ct_initial.inverse() * p;
  return {ct, region_around(ct.grid, points, margin_mm)};
}

CtInReach ct_around(const CtVolume& ct, const PreparedUltrasound& prepared,
                    const Eigen::Isometry3d& T_us_ct, double margin_mm) {
  std::vector<Vector3d> points = prepared.field.us_mm();
  for (Vector3d& p : points) p = T_us_ct.inverse() * p;
  return {ct, region_around(ct.grid, points, margin_mm)};
}

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
  if (const std::size_t count = prepared.field.us_mm().size(); count < kLeastPoints)
    return Refusal{RegistrationStatus::kFailed, words_for_few_samples(count)};
  if (lie_on_a_line(prepared.field.us_mm()))
    return Refusal{RegistrationStatus::kFailed,
                   "what counts in the ultrasound lies on one line: no rotation about it shows"};
  if (EvidencePlan(options.confidence).gathers() && std::min(beams.frames, beams.lines) < 2)
    return Refusal{RegistrationStatus::kFailed,
                   std::string("the ultrasound has one ") + (beams.frames < 2 ? "frame" : "line") +
                       " in another place than the others, must have two at least: its halves "
                       "must agree about a pose for it to be believed"};
  run.report(0.1);

  return run.timed("ct", [&]() -> Outcome<ImagePyramid> {
    ImagePyramid pyramid{
        std::move(prepared), ct_in_reach(ct.ct(), beams, T_us_ct_initial, options.search), {}};
    if (const Eigen::Vector3i& size = pyramid.in_reach.region.size; size.minCoeff() < kLeastVoxels)
      return Refusal{RegistrationStatus::kNoOverlap, words_for_little_ct(size)};
    const std::vector<LevelOptions>& levels = options.search.levels;
    const std::vector<std::shared_ptr<const PackedCt>> cts = packed_cts(
        ct, pyramid.in_reach.region, steps_of(levels, ct.ct().grid), options, run.check());
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
