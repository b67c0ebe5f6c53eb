#include "registration/assessment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "registration/acquisition_check.h"
#include "registration/expected_error.h"
#include "registration/local_agreement.h"
#include "registration/paired_advantage.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/similarity/catalogue.h"

namespace usct::registration {
namespace {

using Eigen::Vector3d;

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/// How many times the similarity of another pose. It is limited, since the other may be next to 0.
double times(const Candidate& best, double other) {
  constexpr double kMost = 100.0;
  return other > 0.0 ? std::clamp(best.value / other, 0.0, kMost) : kMost;
}

/// A pose that is this much less probably wrong than the limit allows is accepted without a search
/// for a mirrored CT, which takes twice as long as that for mirrored ultrasound.
constexpr double kBeyondDoubt = 0.1;

void set_wrong_probability(Measures& measures) {
  if (const std::optional<RightProbability> right = right_probability(measures))
    measures.wrong_probability = 1.0 - right->all();
}

/// The points in the middle of the field of view, where the kidney is.
std::vector<Vector3d> middle_of(const FieldPoints& field, double radius_mm) {
  std::vector<Vector3d> near;
  const Vector3d centre = field.centre_us_mm();
  for (const Vector3d& p : field.us_mm())
    if ((p - centre).norm() <= radius_mm) near.push_back(p);
  return near.empty() ? field.us_mm() : near;
}

/// The median distance by which halves of the field move a pose.
double motion_mm(const HalfPoses& halves, const Eigen::Isometry3d& T_us_ct,
                 const FieldPoints& field) {
  std::vector<double> distances;
  for (const Eigen::Isometry3d& pose : halves.all())
    distances.push_back(field.distance_mm(pose, T_us_ct));
  return median(distances);
}

/// Optima of the search of the evidence, where that differs from the search that found `refined`.
/// The optimum that `refined` leads to comes first.
std::vector<Candidate> optima_around(const SearchProblem& problem, const Candidate& refined,
                                     double rival_mm, Run& run) {
  const Candidate own = optimum_near(problem, refined.T_us_ct, rival_mm, run);
  std::vector<Candidate> optima{own};
  for (const Candidate& found : multi_start(problem, 0, {}, run)) {
    const double distance_mm = problem.field.distance_mm(found.T_us_ct, own.T_us_ct);
    if (distance_mm > rival_mm)
      optima.push_back(found);
    else if (found.value > optima.front().value)
      optima.front() = found;  // the same optimum, climbed higher
  }
  return optima;
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
  double advantage_over(const Candidate& other, const Eigen::Isometry3d& T_mirror) const {
    const MirroredSimilarity mirrored(*similarity_, T_mirror);
    return paired_advantage(best_, mirrored.parts(other.pose()), clusters_);
  }

 private:
  std::shared_ptr<const Similarity> similarity_;
  Clusters clusters_;
  std::vector<double> best_;
};

bool may_be_missed(const Assessment& assessment) {
  const Measures& measures = assessment.measures;
  if (!right_probability(measures)) return true;
  constexpr double kMirrorFound = 0.6;
  constexpr double kMirrorSure = -4.0;
  if (*measures.mirror_ratio < kMirrorFound && *measures.mirror_advantage < kMirrorSure)
    return false;
  // Mirror images say whether a pose should be believed. They do not say whether a better pose
  // exists, so they do not count here.
  Measures firm = measures;
  firm.mirror_ratio = firm.mirror_advantage = std::numeric_limits<double>::infinity();
  const std::optional<RightProbability> right = right_probability(firm);
  return right->chance < 0.5 || right->anatomy < 0.5;
}

bool Assessor::parts_could_save(const Assessment& compared) const {
  const std::optional<double>& limit = options_.confidence.gates.max_wrong_probability;
  Assessment best = compared;
  best.measures.parts_mm = best.measures.tissue_motion_mm = 0.0;
  best.measures.local_agreement = 1.0;
  const std::optional<RightProbability> right = right_probability(best.measures);
  return !limit || !right || 1.0 - right->all() <= *limit || !may_be_missed(best);
}

Assessment Assessor::compare(const std::vector<Candidate>& optima, Run& run) {
  Assessment assessment;
  assessment.measures.displacement_mm =
      images_.prepared.field.distance_mm(optima.front().T_us_ct, problem_.T_us_ct_initial);
  if (gathers(EvidenceSource::kOwn))
    compare_with_others({images_, problem_}, optima, assessment, run);
  return assessment;
}

Outcome<Assessment> Assessor::assess(Assessment assessment, const std::vector<Candidate>& optima,
                                     const Candidate& refined, Run& run) {
  const FieldPoints& field = images_.prepared.field;
  Measures& measures = assessment.measures;
  measures.overlap = refined.overlap;
  measures.displacement_mm = field.distance_mm(refined.T_us_ct, problem_.T_us_ct_initial);
  measures.disagreement_mm = field.distance_mm(refined.T_us_ct, optima.front().T_us_ct);
  if (const std::optional<RefinementOptions>& refinement = options_.refinement) {
    if (refinement->depth_error > 0.0) measures.depth_error = refined.errors.depth;
    if (refinement->sweep_error > 0.0) measures.sweep_error = refined.errors.sweep;
  }
  if (gathers(EvidenceSource::kPatient)) {
    const std::optional<Refusal> refusal = compare_as_patient(refined, assessment, run);
    if (refusal) return *refusal;
  } else if (gathers(EvidenceSource::kOwn)) {
    check_field({images_, problem_}, refined, assessment, run);
    conclude({images_, problem_}, optima.front(), assessment, run);
  }
  return assessment;
}

bool Assessor::gathers(EvidenceSource source) const {
  const ConfidenceOptions& confidence = options_.confidence;
  return confidence.gates.max_wrong_probability && confidence.evidence == source;
}

std::optional<Refusal> Assessor::compare_as_patient(const Candidate& refined,
                                                    Assessment& assessment, Run& run) {
  const RegistrationOptions patient;
  const Outcome<ImagePyramid> images =
      prepare(ultrasound_, ct_, problem_.T_us_ct_initial, patient, run);
  if (!images) return images.refusal();
  const SearchProblem problem{images->similarities(), patient.search, problem_.T_us_ct_initial,
                              images->prepared.field, options_.seed};
  const EvidenceImages on{*images, problem};
  const std::vector<Candidate> optima =
      optima_around(problem, refined, options_.confidence.rival_mm, run);
  compare_with_others(on, optima, assessment, run);
  check_field(on, refined, assessment, run);
  conclude(on, optima.front(), assessment, run);
  return std::nullopt;
}

void Assessor::conclude(const EvidenceImages& on, const Candidate& best, Assessment& assessment,
                        Run& run) const {
  set_wrong_probability(assessment.measures);
  const std::optional<double>& wrong = assessment.measures.wrong_probability;
  const double limit = *options_.confidence.gates.max_wrong_probability;
  const bool in_doubt = wrong && *wrong <= limit && *wrong > kBeyondDoubt * limit;
  if (!in_doubt || ct_is_known_) return;
  compare_with_mirrored_ct(on, best, assessment, run);
  set_wrong_probability(assessment.measures);
}

void Assessor::compare_with_mirrored_ct(const EvidenceImages& on, const Candidate& best,
                                        Assessment& assessment, Run& run) const {
  const PatchComparison patches(on.images, options_.confidence, best);
  double highest = best.value;
  for (const Decoy& decoy : search_mirrored_ct(on.problem, best.T_us_ct, ct_.grid.direction,
                                               options_.confidence.decoys, decoy_rounds_, run)) {
    if (!(decoy.best.value > highest)) continue;
    const double advantage = patches.advantage_over(decoy.best, decoy.T_mirror);
    if (!(advantage < 0.0)) continue;
    highest = decoy.best.value;
    assessment.best_mirror = decoy.mirror;
    assessment.measures.mirror_ratio = times(best, highest);
    assessment.measures.mirror_advantage = advantage;
  }
}

void Assessor::compare_with_others(const EvidenceImages& on, const std::vector<Candidate>& optima,
                                   Assessment& assessment, Run& run) {
  const PatchComparison patches(on.images, options_.confidence, optima.front());
  compare_with_decoys(on, optima.front(), patches, assessment, run);
  compare_with_rivals(on, optima, patches, assessment.measures);
}

void Assessor::check_field(const EvidenceImages& on, const Candidate& refined,
                           Assessment& assessment, Run& run) const {
  const ConfidenceOptions& confidence = options_.confidence;
  compare_clusters(on, refined, assessment.measures, run);
  compare_parts(on, refined, assessment, run);
  const std::optional<AcquisitionErrors> errors = acquisition_errors_at(
      refined.T_us_ct, *on.images.levels.back().images, confidence.ridge_similarity,
      confidence.parts, on.images.prepared.field, run);
  if (!errors) return;
  Measures& measures = assessment.measures;
  if (!measures.depth_error) measures.depth_error = errors->depth;
  if (!measures.sweep_error) measures.sweep_error = errors->sweep;
}

void Assessor::compare_with_decoys(const EvidenceImages& on, const Candidate& best,
                                   const PatchComparison& patches, Assessment& result, Run& run) {
  if (!decoys_)
    decoys_ = search_decoys(on.problem, best.T_us_ct, on.images.prepared.us->beams,
                            options_.confidence.decoys, decoy_rounds_, run);
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

void Assessor::compare_with_rivals(const EvidenceImages& on, const std::vector<Candidate>& optima,
                                   const PatchComparison& patches, Measures& measures) const {
  constexpr std::size_t kRivals = 3;
  const Candidate& best = optima.front();
  std::vector<const Candidate*> rivals;
  for (const Candidate& other : optima)
    if (rivals.size() < kRivals && on.images.prepared.field.distance_mm(
                                       other.T_us_ct, best.T_us_ct) > options_.confidence.rival_mm)
      rivals.push_back(&other);
  measures.rival_ratio = rivals.empty() ? measures.chance_ratio : times(best, rivals[0]->value);
  measures.rival_advantage = measures.chance_advantage;
  if (rivals.empty() || !patches.is_possible()) return;
  double least = std::numeric_limits<double>::infinity();
  for (const Candidate* rival : rivals)
    least = std::min(least, patches.advantage_over(*rival, Eigen::Isometry3d::Identity()));
  measures.rival_advantage = least;
}

void Assessor::compare_clusters(const EvidenceImages& on, const Candidate& refined,
                                Measures& measures, Run& run) const {
  const ConfidenceOptions& confidence = options_.confidence;
  const auto patches = make_similarity(*on.images.levels.back().images, confidence.similarity);
  if (!patches) return;
  // Clusters near the middle are those that reach into the region of the expected error.
  const LocalAgreementOptions options{
      confidence.cluster_mm, confidence.cluster_step_mm, on.images.prepared.field.centre_us_mm(),
      confidence.error.target_radius_mm + 0.5 * confidence.cluster_mm};
  const std::optional<LocalAgreement> found =
      local_agreement(*patches, refined.T_us_ct, options, run);
  if (!found) return;
  measures.local_agreement = found->share;
  measures.tissue_motion_mm = found->tissue_motion_mm;
}

void Assessor::compare_parts(const EvidenceImages& on, const Candidate& refined, Assessment& result,
                             Run& run) const {
  const ConfidenceOptions& confidence = options_.confidence;
  const FieldPoints& field = on.images.prepared.field;
  const std::vector<std::optional<HalfPoses>> found = poses_of_halves(
      *on.images.levels.back().images, {confidence.similarity, confidence.ridge_similarity},
      confidence.parts, refined.T_us_ct, field, run);
  std::optional<double>* const moved_mm[] = {&result.measures.parts_mm,
                                             &result.measures.ridge_parts_mm};
  std::vector<HalfPoses> halves;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i]) continue;
    *moved_mm[i] = motion_mm(*found[i], refined.T_us_ct, field);
    halves.push_back(*found[i]);
  }
  if (halves.empty()) return;
  const ErrorOptions& error = confidence.error;
  result.covariance = pose_covariance(halves, ultrasound_.beams, field.centre_us_mm(), error) +
                      shift_covariance(result.measures.tissue_motion_mm.value_or(0.0));
  const double expected_mm =
      expected_tre_mm(*result.covariance, middle_of(field, error.target_radius_mm)).rms_mm;
  result.measures.expected_error_mm = expected_mm;
  result.measures.error_bound_mm = error.bound_factor * expected_mm;
}

}  // namespace usct::registration
