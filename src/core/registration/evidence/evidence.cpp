#include "registration/evidence/evidence.h"

#include <algorithm>
#include <cmath>

#include "order_statistics.h"
#include "registration/evidence/acquisition_check.h"
#include "registration/evidence/doubts.h"
#include "registration/evidence/expected_error.h"
#include "registration/evidence/field_axes.h"
#include "registration/evidence/local_agreement.h"
#include "registration/evidence/mirror_agreement.h"
#include "registration/evidence/paired_advantage.h"
#include "registration/evidence_plan.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/registration/right_probability.h"
#include "us_ct_registration/similarity/catalogue.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// The factor by which a pose has more similarity than another. It is limited, since the other may
/// be next to 0.
double times(const Candidate& best, double other) {
  constexpr double kMost = 100.0;
  return other > 0.0 ? std::clamp(best.value / other, 0.0, kMost) : kMost;
}

/// The points in the middle of the field of view, where the kidney is.
std::vector<Vector3d> middle_of(const FieldPoints& field, double radius_mm) {
  std::vector<Vector3d> near;
  const Vector3d centre = field.centre_us_mm();
  for (const Vector3d& p : field.us_mm())
    if ((p - centre).norm() <= radius_mm) near.push_back(p);
  return near.empty() ? field.us_mm() : near;
}

/// Clusters near the middle are those that reach into the region of the expected error.
LocalAgreementOptions agreement_options(const EvidenceInput& in, const FieldPoints& field) {
  const double cluster_mm = in.options.cluster_mm;
  const double radius_mm = in.options.error.target_radius_mm + 0.5 * cluster_mm;
  return {cluster_mm,
          in.options.cluster_step_mm,
          {field.centre_us_mm(), radius_mm, field_axes(in.ultrasound.beams).elevation}};
}

/// The median distance by which halves of the field move a pose.
double motion_mm(const HalfPoses& halves, const Isometry3d& T_us_ct, const FieldPoints& field) {
  std::vector<double> distances;
  for (const Isometry3d& pose : halves.all()) distances.push_back(field.distance_mm(pose, T_us_ct));
  return median(distances);
}

}  // namespace

/// Compares poses with the best one patch by patch, by a similarity that did not choose it.
class PatchComparison {
 public:
  PatchComparison(const ImagePyramid& images, const ConfidenceOptions& options,
                  const Candidate& best)
      : similarity_(make_similarity(*images.levels.back().images, options.similarity)) {
    if (!similarity_) return;
    clusters_ = Clusters(similarity_->part_centres_us_mm(), options.cluster_mm);
    best_ = similarity_->parts(best.pose());
  }
  bool is_possible() const { return clusters_.count() > 0; }
  /// Student's t of the best pose against a pose of the mirrored ultrasound.
  double advantage_over(const Candidate& other, const Isometry3d& T_mirror) const {
    const MirroredSimilarity mirrored(*similarity_, T_mirror);
    return paired_advantage(best_, mirrored.parts(other.pose()), clusters_);
  }

 private:
  std::shared_ptr<const Similarity> similarity_;
  Clusters clusters_;
  std::vector<double> best_;
};

void Evidence::compare(const std::vector<Candidate>& optima, Assessment& assessment, Run& run) {
  if (!decoys_) return compare_further(optima, decoy_rounds_, assessment, run);
  const PatchComparison patches(in_.images, in_.options, optima.front());
  compare_with_decoys(optima.front(), patches, assessment);
  compare_with_rivals(optima, patches, assessment.measures);
}

void Evidence::compare_further(const std::vector<Candidate>& optima, int rounds,
                               Assessment& assessment, Run& run) {
  decoy_rounds_ = rounds;
  const Isometry3d& T_us_ct = optima.front().T_us_ct;
  decoys_ = decoys_
                ? searched_further(*std::move(decoys_), in_.problem, T_us_ct, rounds, run)
                : search_decoys(in_.problem, T_us_ct, in_.images.prepared.us->beams, rounds, run);
  compare(optima, assessment, run);
}

void Evidence::check(const Candidate& refined, Assessment& assessment, Run& run) {
  const Candidate stretched = estimate_errors(refined, assessment.measures, run);
  compare_clusters(stretched, assessment, run);
  const std::vector<HalfPoses> halves = compare_parts(refined, assessment.measures, run);
  if (!halves.empty()) expect_error(halves, assessment);
  assessment.measures.wrong_probability = wrong_probability(assessment.measures);
}

bool Evidence::blocks_agree(const Candidate& pose, Run& run) const {
  // Standard errors by which the gain must differ from nothing. In strangers' CTs hardly any pose
  // of matched blocks reaches it; with less no pose has been believed.
  constexpr double kSure = 3.5;
  const auto patches = make_similarity(deciding_images(), in_.options.similarity);
  if (!patches) return false;
  const std::optional<LocalAgreement> found =
      local_agreement(*patches, pose, agreement_options(in_, field()), run);
  return found && found->advantage >= kSure;
}

void Evidence::settle(const Candidate& best, Assessment& assessment, Run& run) {
  if (!decoys_) return;
  Measures& measures = assessment.measures;
  const double limit = *in_.options.gates.max_wrong_probability;
  const EvidencePlan plan(in_.options);
  if (!is_beyond_doubt(measures, limit)) {
    if (!plan.accepts(if_no_mirror_agrees(measures))) return;
    compare_agreement(measures, run);
    measures.wrong_probability = wrong_probability(measures);
  }
  if (!ct_is_known_ && plan.accepts(measures) &&
      may_be_in_mirrored_ct(measures, lacks_a_side(*decoys_), limit))
    compare_with_mirrored_ct(best, assessment, run);
}

void Evidence::compare_with_decoys(const Candidate& best, const PatchComparison& patches,
                                   Assessment& result) const {
  if (decoys_->empty()) return;
  std::vector<double> values;
  for (const Decoy& decoy : *decoys_) values.push_back(decoy.best.value);
  const auto highest = std::max_element(values.begin(), values.end());
  result.best_mirror = (*decoys_)[static_cast<std::size_t>(highest - values.begin())].mirror;
  result.measures.mirror_ratio = times(best, *highest);
  result.measures.chance_ratio = times(best, median(values));
  if (!patches.is_possible()) return;
  std::vector<double> advantages;
  for (const Decoy& decoy : *decoys_)
    advantages.push_back(patches.advantage_over(decoy.best, decoy.T_mirror));
  result.measures.mirror_advantage = *std::min_element(advantages.begin(), advantages.end());
  result.measures.chance_advantage = median(advantages);
}

void Evidence::compare_with_rivals(const std::vector<Candidate>& optima,
                                   const PatchComparison& patches, Measures& measures) const {
  const std::vector<Candidate> rivals = rivals_of(optima, in_.options.rival_mm, field());
  measures.rival_ratio =
      rivals.empty() ? measures.chance_ratio : times(optima.front(), rivals.front().value);
  measures.rival_advantage = measures.chance_advantage;
  if (rivals.empty() || !patches.is_possible()) return;
  std::vector<double> advantages;
  for (const Candidate& rival : rivals)
    advantages.push_back(patches.advantage_over(rival, Isometry3d::Identity()));
  measures.rival_advantage = *std::min_element(advantages.begin(), advantages.end());
}

Candidate Evidence::estimate_errors(const Candidate& refined, Measures& measures, Run& run) const {
  const std::optional<AcquisitionCheck> found = check_acquisition(
      refined, deciding_images(), in_.options.ridge_similarity, in_.options, field(), run);
  if (!found) return refined;
  measures.depth_error = found->errors.depth;
  measures.sweep_error = found->errors.sweep;
  measures.sweep_unevenness = found->errors.unevenness;
  measures.errors_ratio = found->ratio;
  measures.errors_advantage = found->advantage;
  return shown_errors(measures).are_of_sweep_alone() ? Candidate{found->T_us_ct, found->errors}
                                                     : refined;
}

SimilarityImages& Evidence::images_for(const Measures& measures) {
  if (!shown_errors(measures).are_of_sweep_alone()) return deciding_images();
  if (!along_beams_) along_beams_.emplace(with_beams(deciding_images()));
  return *along_beams_;
}

void Evidence::compare_clusters(const Candidate& pose, Assessment& assessment, Run& run) {
  Measures& measures = assessment.measures;
  const auto patches = make_similarity(images_for(measures), in_.options.similarity);
  if (!patches) return;
  const std::optional<LocalAgreement> found =
      local_agreement(*patches, pose, agreement_options(in_, field()), run);
  if (!found) return;
  measures.local_agreement = found->share;
  measures.local_advantage = found->advantage;
  measures.tissue_motion_mm = found->tissue_motion_mm;
  measures.wide_motion_mm = found->wide_motion_mm;
  measures.deformation_mm = found->deformation_mm;
  assessment.wished_motion = found->wished_motion;
}

std::vector<HalfPoses> Evidence::compare_parts(const Candidate& refined, Measures& measures,
                                               Run& run) const {
  const ConfidenceOptions& confidence = in_.options;
  const std::vector<std::optional<HalfPoses>> found =
      poses_of_halves(deciding_images(), {confidence.similarity, confidence.ridge_similarity},
                      confidence.parts, refined.T_us_ct, field(), run);
  std::optional<double>* const moved_mm[] = {&measures.parts_mm, &measures.ridge_parts_mm};
  std::vector<HalfPoses> halves;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i]) continue;
    *moved_mm[i] = motion_mm(*found[i], refined.T_us_ct, field());
    halves.push_back(*found[i]);
  }
  return halves;
}

void Evidence::expect_error(const std::vector<HalfPoses>& halves, Assessment& result) const {
  Measures& measures = result.measures;
  const ErrorOptions& error = in_.options.error;
  AcquisitionErrors estimated;
  // The estimate of the depths is biased, so that it must show clearly; that of the sweep is not.
  estimated.depth = shown_errors(measures).errors.depth;
  estimated.sweep = measures.sweep_error.value_or(0.0);
  const BeamGrid recorded = frames_that_count(in_.ultrasound.beams, *in_.images.prepared.us);
  result.covariance = pose_covariance(halves, recorded, field().centre_us_mm(), error, estimated) +
                      shift_covariance(measures.deformation_mm.value_or(0.0));
  const double expected_mm =
      expected_tre_mm(*result.covariance, middle_of(field(), error.target_radius_mm)).rms_mm;
  measures.expected_error_mm = expected_mm;
  measures.error_bound_mm = error.bound_factor * expected_mm;
}

void Evidence::compare_agreement(Measures& measures, Run& run) {
  SimilarityImages& images = images_for(measures);
  const auto fitted = make_similarity(images, in_.options.ridge_similarity);
  const auto asked = make_similarity(images, in_.options.similarity);
  if (!fitted || !asked) return;
  // Mirror images get the same freedom as the pose.
  AcquisitionErrors errors;
  if (shown_errors(measures).are_of_sweep_alone())
    errors = most_errors(in_.options.ridge_similarity);
  errors.depth = 0.0;
  measures.mirror_agreement = mirror_agreement(*decoys_, *fitted, *asked, in_.options.parts, errors,
                                               agreement_options(in_, field()), field(), run);
}

void Evidence::compare_with_mirrored_ct(const Candidate& best, Assessment& assessment, Run& run) {
  const PatchComparison patches(in_.images, in_.options, best);
  if (!patches.is_possible()) return;
  mirrored_ct_ = mirrored_ct_ ? searched_further(*std::move(mirrored_ct_), in_.problem,
                                                 best.T_us_ct, decoy_rounds_, run)
                              : search_mirrored_ct(in_.problem, best.T_us_ct, in_.ct.grid.direction,
                                                   decoy_rounds_, run);
  const Measures without = assessment.measures;
  double most = best.value;
  for (const Decoy& decoy : *mirrored_ct_) {
    if (!(decoy.best.value > most)) continue;
    const std::optional<Measures> doubted = doubted_for_mirrored_ct(
        without, times(best, decoy.best.value), patches.advantage_over(decoy.best, decoy.T_mirror));
    if (!doubted) continue;
    most = decoy.best.value;
    assessment.measures = *doubted;
    assessment.best_mirror = decoy.mirror;
  }
}

}  // namespace usct::registration
