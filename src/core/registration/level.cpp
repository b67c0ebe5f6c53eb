#include "registration/level.h"

#include <algorithm>
#include <cmath>

#include "us_ct_registration/similarity/simulated_lc2.h"
#include "us_ct_registration/ultrasound/decimation.h"

namespace usct::registration {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr std::size_t kPoints = 2000;
/// Beyond what the starts reach: optimizers go on, and smoothing looks around.
constexpr double kMarginMm = 15.0;
constexpr double kMostTurnRad = 1.2;

std::vector<Vector3d> counting_points(const BeamUltrasound& us) {
  const auto counting = static_cast<std::size_t>(std::count_if(
      us.known.begin(), us.known.end(), [](std::uint8_t known) { return known != 0; }));
  const std::size_t step = std::max<std::size_t>(1, counting / kPoints);
  std::vector<Vector3d> points;
  std::size_t i = 0;
  std::size_t to_skip = 0;  // counted down, for a remainder takes far longer
  for (int f = 0; f < us.beams.frames; ++f)
    for (int l = 0; l < us.beams.lines; ++l)
      for (int s = 0; s < us.beams.samples(); ++s, ++i) {
        if (us.known[i] == 0) continue;
        if (to_skip == 0) points.push_back(us.beams.point(f, l, s));
        to_skip = to_skip == 0 ? step - 1 : to_skip - 1;
      }
  return points;
}

/// First and last samples of beams all over the sweep.
std::vector<Vector3d> outline(const BeamGrid& beams) {
  constexpr int kSteps = 6;
  std::vector<Vector3d> points;
  for (int f = 0; f <= kSteps; ++f)
    for (int l = 0; l <= kSteps; ++l)
      for (const int s : {0, beams.samples() - 1})
        points.push_back(
            beams.point(f * (beams.frames - 1) / kSteps, l * (beams.lines - 1) / kSteps, s));
  return points;
}

bool simulates(const StageOptions& stage) {
  return stage.similarity.kind == SimilarityKind::kSimulatedLc2;
}

/// Beams cost memory and time; positions are enough unless a similarity looks along them, or a
/// stage moves samples along them.
PatchContents contents_for(const RegistrationOptions& options) {
  const auto looks_along = [](const SimilarityOptions& similarity) {
    return similarity.channel == GradientChannel::kAlongBeam;
  };
  const bool any =
      std::any_of(options.stages.begin(), options.stages.end(), [&](const auto& stage) {
        return stage.depth_error > 0.0 || stage.sweep_error > 0.0 || looks_along(stage.similarity);
      });
  return any || looks_along(options.confidence.confirmation) ? PatchContents::kWithBeams
                                                             : PatchContents::kPositions;
}

Vector3i factors_to(double spacing_mm, const Grid& grid, const Vector3i& available) {
  Vector3i factors;
  for (int axis = 0; axis < 3; ++axis)
    factors[axis] = std::clamp(static_cast<int>(std::lround(spacing_mm / grid.spacing_mm[axis])), 1,
                               std::max(1, available[axis] / 2));
  return factors;
}

}  // namespace

PreparedUltrasound prepare_ultrasound(const BeamUltrasound& ultrasound,
                                      const RegistrationOptions& options, const Progress& check) {
  const BeamUltrasound averaged =
      decimate(ultrasound, factors_for_spacing(ultrasound.beams, options.conditioning_spacing_mm));
  ConditionedUltrasound conditioned = condition(averaged, options.conditioning, check);
  PreparedUltrasound prepared;
  prepared.us.beams = averaged.beams;
  prepared.us.brightness = std::move(conditioned.samples);
  prepared.us.known.resize(conditioned.reasons.size());
  std::transform(conditioned.reasons.begin(), conditioned.reasons.end(), prepared.us.known.begin(),
                 [](std::uint8_t reasons) { return reasons == 0 ? 1 : 0; });
  prepared.points_us_mm = counting_points(prepared.us);
  return prepared;
}

CtInReach ct_in_reach(const CtVolume& ct, const BeamGrid& beams,
                      const Eigen::Isometry3d& T_us_ct_initial,
                      const RegistrationOptions& options) {
  std::vector<Vector3d> points = outline(beams);
  double margin_mm = kMarginMm;
  if (const std::optional<StartOptions>& starts = options.stages.front().starts) {
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& p : points) centre += p / static_cast<double>(points.size());
    double radius_mm = 0.0;
    for (const Vector3d& p : points) radius_mm = std::max(radius_mm, (p - centre).norm());
    margin_mm += starts->translation_mm + radius_mm * std::min(kMostTurnRad, starts->rotation_rad);
  }
  for (Vector3d& p : points) p = T_us_ct_initial.inverse() * p;
  return {ct, region_around(ct.grid, points, margin_mm)};
}

CtInReach ct_around(const CtVolume& ct, const PreparedUltrasound& prepared,
                    const Eigen::Isometry3d& T_us_ct, double margin_mm) {
  std::vector<Vector3d> points = prepared.points_us_mm;
  for (Vector3d& p : points) p = T_us_ct.inverse() * p;
  return {ct, region_around(ct.grid, points, margin_mm)};
}

Volume<float> ct_level(const CtInReach& in_reach, const StageOptions& stage) {
  if (simulates(stage)) return {};
  return shrink(in_reach.ct, factors_to(stage.spacing_mm, in_reach.ct.grid, in_reach.region.size),
                in_reach.region);
}

std::vector<Volume<float>> ct_levels(const CtInReach& in_reach, const RegistrationOptions& options,
                                     std::size_t count, const Progress& check) {
  std::vector<Volume<float>> levels(count);
  const Volume<float>* finer = nullptr;
  for (std::size_t i = count; i-- > 0;) {
    const StageOptions& stage = options.stages[i];
    if (simulates(stage)) continue;
    if (check) check(static_cast<double>(count - 1 - i) / static_cast<double>(count));
    levels[i] = finer == nullptr
                    ? ct_level(in_reach, stage)
                    : shrink(*finer, factors_to(stage.spacing_mm, finer->grid, finer->grid.size),
                             whole(finer->grid));
    finer = &levels[i];
  }
  return levels;
}

LevelImages::LevelImages(const StageOptions& stage, const PreparedUltrasound& prepared,
                         const Volume<float>& ct, const RegistrationOptions& options)
    : us_(prepared.us),
      ct_(std::make_shared<const PackedCt>(ct, options.window, options.outside_hu)),
      contents_(contents_for(options)) {
  const Vector3i factors = factors_for_spacing(us_.beams, stage.spacing_mm);
  if (factors != Vector3i::Ones()) averaged_ = decimate(us_, factors);
}

std::shared_ptr<const Similarity> LevelImages::similarity(const SimilarityOptions& options) {
  auto found = std::find_if(patches_.begin(), patches_.end(),
                            [&](const auto& cut) { return cut.first == options.patches; });
  if (found == patches_.end())
    found = patches_.insert(
        found, {options.patches, std::make_shared<const UltrasoundPatches>(
                                     cut_into_patches(us(), options.patches, contents_))});
  return make_patch_similarity(found->second, ct_, options);
}

Level make_level(const StageOptions& stage, const PreparedUltrasound& prepared,
                 const CtInReach& in_reach, const Volume<float>& ct, bool with_confirmation,
                 const RegistrationOptions& options) {
  Level level;
  if (simulates(stage)) {
    const Vector3i factors = factors_for_spacing(prepared.us.beams, stage.spacing_mm);
    level.similarity =
        make_simulated_lc2(decimate(prepared.us, factors), {}, crop(in_reach.ct, in_reach.region),
                           options.simulation, options.fit);
    return level;
  }
  level.images = std::make_shared<LevelImages>(stage, prepared, ct, options);
  level.similarity = level.images->similarity(stage.similarity);
  if (with_confirmation)
    level.confirmation = level.images->similarity(options.confidence.confirmation);
  return level;
}

bool shares_images(const StageOptions& stage, const StageOptions& other) {
  return stage.spacing_mm == other.spacing_mm && !simulates(stage) && !simulates(other);
}

}  // namespace usct::registration
