#include "registration/evidence/acquisition_check.h"

#include <algorithm>
#include <cmath>

#include "registration/evidence/clusters.h"
#include "registration/evidence/paired_advantage.h"
#include "us_ct_registration/similarity/catalogue.h"

namespace usct::registration {
namespace {

/// How much more similar one pose with errors is than another.
struct Comparison {
  double ratio = 1.0;
  double advantage = 0.0;  // patch by patch
};

// In 22 phantoms of ten kinds with right geometry, the ratio was 1.02 at most where the advantage
// was above 2.5. With depths that were 4 % wrong it was 1.01 to 1.15.
bool is_clear(const Comparison& comparison) {
  constexpr double kRatio = 1.04;
  constexpr double kAdvantage = 2.5;
  return comparison.ratio > kRatio && comparison.advantage > kAdvantage;
}

/// Whether a pose with errors is the optimum that `recorded` is without any. The climb has left it
/// where the pose has moved further than errors make it move: wrong depths displace the whole
/// field along the beams, a wrong sweep its ends only.
bool is_same_optimum(const Candidate& with_errors, const Candidate& recorded, const BeamGrid& beams,
                     const FieldPoints& field) {
  constexpr double kSameMm = 4.0;  // as far as optima of a search are one
  const Beam& middle = beams.beam(beams.frames / 2, beams.lines / 2);
  const double depth_mm = (field.centre_us_mm() - middle.origin_mm).norm();
  return field.distance_mm(with_errors.T_us_ct, recorded.T_us_ct) <=
         kSameMm + std::abs(with_errors.errors.depth) * depth_mm;
}

/// Climbs over pose and errors near one pose.
class ErrorClimbs {
 public:
  ErrorClimbs(const Similarity& similarity, const Candidate& from, const ConfidenceOptions& options,
              const FieldPoints& field, Run& run)
      : similarity_(similarity),
        from_(from),
        how_(options.parts),
        field_(field),
        run_(run),
        clusters_(similarity.part_centres_us_mm(), options.cluster_mm) {}

  /// The best pose with errors within the limits.
  Candidate best(const AcquisitionErrors& limits) const {
    // In mm and per cent: an error that matters lies several per cent away, along a flat ridge.
    constexpr double kStep = 4.0;
    OptimizerOptions optimizer = how_.optimizer;
    if (limits.any()) optimizer.initial_step = std::max(kStep, optimizer.initial_step);
    return climbed(similarity_, {optimizer, how_.reach_mm, limits}, field_, from_, run_);
  }
  Comparison compare(const Candidate& one, const Candidate& other) const {
    if (!(other.value > 0.0)) return {};
    return {one.value / other.value, paired_advantage(similarity_.parts(one.pose()),
                                                      similarity_.parts(other.pose()), clusters_)};
  }

 private:
  const Similarity& similarity_;
  const Candidate from_;
  const PartOptions& how_;
  const FieldPoints& field_;
  Run& run_;
  const Clusters clusters_;
};

}  // namespace

AcquisitionErrors most_errors(const SimilarityOptions& similarity) {
  constexpr double kMostError = 0.15;
  const SimilarityNeeds needs = needs_of(similarity);
  return {needs.follows_depth_error ? kMostError : 0.0,
          needs.follows_sweep_error ? kMostError : 0.0,
          needs.follows_sweep_error ? kMostError : 0.0};
}

SimilarityImages with_beams(const SimilarityImages& images) {
  return {std::make_shared<const BeamUltrasound>(images.ultrasound()), images.packed_ct(), nullptr,
          true, images.backend()};
}

std::optional<AcquisitionCheck> check_acquisition(const Candidate& judged,
                                                  const SimilarityImages& images,
                                                  const SimilarityOptions& similarity,
                                                  const ConfidenceOptions& options,
                                                  const FieldPoints& field, Run& run) {
  if (!needs_of(similarity).has_parts) return std::nullopt;
  SimilarityImages along_beams = with_beams(images);
  const std::shared_ptr<const Similarity> stretched =
      make_similarity(along_beams, on_samples(similarity, SampleSubset::kHalf));
  if (!stretched || stretched->part_centres_us_mm().empty()) return std::nullopt;
  const ErrorClimbs climbs(*stretched, {judged.T_us_ct, {}}, options, field, run);
  const AcquisitionErrors most = most_errors(similarity);
  const AcquisitionErrors depth{most.depth, 0.0, 0.0};
  const AcquisitionErrors sweep{0.0, most.sweep, most.unevenness};
  const Candidate recorded = climbs.best({});
  if (!is_same_optimum(judged, recorded, images.ultrasound().beams, field))
    return AcquisitionCheck{{}, judged.T_us_ct, 1.0, 0.0};
  const Candidate all = climbs.best(most);
  const auto is_same = [&](const Candidate& with_errors) {
    return is_same_optimum(with_errors, recorded, images.ultrasound().beams, field);
  };
  if (!is_same(all)) return AcquisitionCheck{{}, recorded.T_us_ct, 1.0, 0.0};
  const Comparison gain = climbs.compare(all, recorded);
  // Errors may take up what others leave over. They do not count where the ultrasound fits about as
  // well without them.
  std::optional<Candidate> simpler;
  if (is_clear(gain))
    for (const AcquisitionErrors& some : {depth, sweep}) {
      const Candidate alone = climbs.best(some);
      if (!is_same(alone) || is_clear(climbs.compare(all, alone))) continue;
      if (!simpler || alone.value > simpler->value) simpler = alone;
    }
  const Candidate best = simpler.value_or(all);
  return AcquisitionCheck{best.errors, best.T_us_ct, gain.ratio, gain.advantage};
}

bool ShownErrors::has_wrong_depths() const {
  constexpr double kBias = 0.02;
  return std::abs(errors.depth) > kBias;
}

bool ShownErrors::has_wrong_sweep() const {
  constexpr double kBias = 0.05;
  return std::abs(errors.sweep) + std::abs(errors.unevenness) > kBias;
}

bool ShownErrors::are_of_sweep_alone() const {
  return (errors.sweep != 0.0 || errors.unevenness != 0.0) && !has_wrong_depths();
}

ShownErrors shown_errors(const Measures& measures) {
  if (!is_clear({measures.errors_ratio.value_or(1.0), measures.errors_advantage.value_or(0.0)}))
    return {};
  return {{measures.depth_error.value_or(0.0), measures.sweep_error.value_or(0.0),
           measures.sweep_unevenness.value_or(0.0)}};
}

}  // namespace usct::registration
