#include "registration/assessment.h"

#include <limits>

#include "registration/as_patient.h"

namespace usct::registration {

struct Assessor::AsPatient {
  AsPatient(const Assessor& of, RegistrationOptions patient, ImagePyramid prepared)
      : options(std::move(patient)),
        images(std::move(prepared)),
        problem{images.similarities(), options.search, of.problem_.T_us_ct_initial,
                images.prepared.field, of.options_.seed},
        evidence({of.ultrasound_, of.ct_.ct(), images, problem, options.confidence}) {}

  const RegistrationOptions options;
  const ImagePyramid images;
  const SearchProblem problem;
  Evidence evidence;
  /// The optima of its search.
  std::vector<Candidate> searched;
};

namespace {

/// The comparison of a pose, as if all parts of the field agreed about it.
Assessment with_best_parts(Assessment compared) {
  Measures& measures = compared.measures;
  measures.parts_mm = measures.tissue_motion_mm = 0.0;
  measures.local_agreement = 1.0;
  if (const std::optional<RightProbability> right = right_probability(measures))
    measures.wrong_probability = 1.0 - right->all();
  return compared;
}

/// Optima of the search of the evidence, where that differs from the search that found `refined`.
/// The optimum that `refined` leads to comes first.
std::vector<Candidate> optima_around(const SearchProblem& problem, const Candidate& refined,
                                     const std::vector<Candidate>& searched, double rival_mm,
                                     Run& run) {
  const Candidate own = optimum_near(problem, refined.T_us_ct, rival_mm, run);
  std::vector<Candidate> optima{own};
  for (const Candidate& found : searched) {
    const double distance_mm = problem.field.distance_mm(found.T_us_ct, own.T_us_ct);
    if (distance_mm > rival_mm)
      optima.push_back(found);
    else if (found.value > optima.front().value)
      optima.front() = found;  // the same optimum, climbed higher
  }
  return optima;
}

}  // namespace

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
  firm.mirror_agreement.reset();
  const std::optional<RightProbability> right = right_probability(firm);
  return right->chance < 0.5 || right->anatomy < 0.5;
}

Assessor::Assessor(const BeamUltrasound& ultrasound, const PreparedCt& ct,
                   const ImagePyramid& images, const SearchProblem& problem,
                   const RegistrationOptions& options)
    : ultrasound_(ultrasound),
      ct_(ct),
      images_(images),
      problem_(problem),
      options_(options),
      own_({ultrasound, ct.ct(), images, problem, options.confidence}) {}

Assessor::~Assessor() = default;

void Assessor::search_decoys_further(int rounds) {
  decoy_rounds_ = rounds;
  own_.search_decoys_further(rounds);
  if (as_patient_) as_patient_->evidence.search_decoys_further(rounds);
}

bool Assessor::parts_could_save(const Assessment& compared) const {
  const std::optional<double>& limit = options_.confidence.gates.max_wrong_probability;
  const Assessment best = with_best_parts(compared);
  if (!limit || !best.measures.wrong_probability) return true;
  if (may_go_on_as_patient(options_)) return is_beyond_doubt(best.measures, *limit);
  return *best.measures.wrong_probability <= *limit || !may_be_missed(best);
}

bool Assessor::gathers_own() const {
  return gathers() && options_.confidence.evidence != EvidenceSource::kPatient;
}

Assessment Assessor::compare(const std::vector<Candidate>& optima, Run& run) {
  Assessment assessment;
  assessment.measures.displacement_mm =
      images_.prepared.field.distance_mm(optima.front().T_us_ct, problem_.T_us_ct_initial);
  if (gathers_own()) own_.compare(optima, assessment, run);
  return assessment;
}

void Assessor::measure_pose(const Candidate& optimum, const Candidate& refined,
                            Measures& measures) const {
  const FieldPoints& field = images_.prepared.field;
  measures.overlap = refined.overlap;
  measures.displacement_mm = field.distance_mm(refined.T_us_ct, problem_.T_us_ct_initial);
  measures.disagreement_mm = field.distance_mm(refined.T_us_ct, optimum.T_us_ct);
  if (const std::optional<RefinementOptions>& refinement = options_.refinement) {
    if (refinement->depth_error > 0.0) measures.depth_error = refined.errors.depth;
    if (refinement->sweep_error > 0.0) measures.sweep_error = refined.errors.sweep;
  }
}

Outcome<Assessment> Assessor::assess(Assessment compared, const std::vector<Candidate>& optima,
                                     const Candidate& refined, Run& run) {
  measure_pose(optima.front(), refined, compared.measures);
  if (!gathers()) return compared;
  if (gathers_own()) {
    const std::optional<double>& limit = options_.confidence.gates.max_wrong_probability;
    own_.check(refined, compared, run);
    // Evidence that takes long is not worth it for a pose in doubt if the registration goes on.
    if (!may_go_on_as_patient(options_) || is_beyond_doubt(compared.measures, *limit))
      own_.settle(optima.front(), compared, run);
    return compared;
  }
  const std::optional<Refusal> refusal = assess_as_patient(refined, compared, run);
  if (refusal) return *refusal;
  return compared;
}

std::optional<Refusal> Assessor::assess_as_patient(const Candidate& refined, Assessment& assessment,
                                                   Run& run) {
  if (!as_patient_) {
    RegistrationOptions options = as_patient(options_);
    Outcome<ImagePyramid> images =
        prepare(ultrasound_, ct_, problem_.T_us_ct_initial, options, run);
    if (!images) return images.refusal();
    as_patient_ = std::make_unique<AsPatient>(*this, std::move(options), std::move(*images));
    as_patient_->evidence.search_decoys_further(decoy_rounds_);
    as_patient_->searched = multi_start(as_patient_->problem, 0, {}, run);
  }
  const std::vector<Candidate> optima =
      optima_around(as_patient_->problem, refined, as_patient_->searched,
                    as_patient_->options.confidence.rival_mm, run);
  as_patient_->evidence.compare(optima, assessment, run);
  as_patient_->evidence.check(refined, assessment, run);
  as_patient_->evidence.settle(optima.front(), assessment, run);
  return std::nullopt;
}

}  // namespace usct::registration
