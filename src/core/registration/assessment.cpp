#include "registration/assessment.h"

#include "registration/evidence/doubts.h"

namespace usct::registration {

struct Assessor::AsPatient {
  AsPatient(const Assessor& of, RegistrationOptions patient, ImagePyramid prepared)
      : options(std::move(patient)),
        images(std::move(prepared)),
        problem{images.similarities(), options.search, of.in_.T_us_ct_initial,
                images.prepared.field, options.seed},
        evidence({of.in_.ultrasound, of.in_.ct.ct(), images, problem, options.confidence}) {}

  const RegistrationOptions options;
  const ImagePyramid images;
  const SearchProblem problem;
  Evidence evidence;
  /// The optima of its search.
  std::vector<Candidate> searched;
};

namespace {

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

Assessor::Assessor(const RegistrationInput& input, const ImagePyramid& images,
                   const SearchProblem& problem)
    : in_(input),
      images_(images),
      problem_(problem),
      plan_(input.options.confidence),
      own_({input.ultrasound, input.ct.ct(), images, problem, input.options.confidence}) {}

Assessor::~Assessor() = default;

void Assessor::search_decoys_further(int rounds) {
  decoy_rounds_ = rounds;
  own_.search_decoys_further(rounds);
  if (as_patient_) as_patient_->evidence.search_decoys_further(rounds);
}

bool Assessor::parts_could_save(const Assessment& compared) const {
  const Measures best = if_parts_agree(compared.measures);
  if (!best.wrong_probability) return true;
  return !plan_.goes_on_as_patient(best) && (plan_.accepts(best) || !may_be_missed(best));
}

Assessment Assessor::compare(const std::vector<Candidate>& optima, Run& run) {
  Assessment assessment;
  assessment.measures.displacement_mm =
      images_.prepared.field.distance_mm(optima.front().T_us_ct, in_.T_us_ct_initial);
  if (plan_.gathers_own()) own_.compare(optima, assessment, run);
  return assessment;
}

void Assessor::measure_pose(const Candidate& optimum, const Candidate& refined,
                            Measures& measures) const {
  const FieldPoints& field = images_.prepared.field;
  measures.overlap = refined.overlap;
  measures.displacement_mm = field.distance_mm(refined.T_us_ct, in_.T_us_ct_initial);
  measures.disagreement_mm = field.distance_mm(refined.T_us_ct, optimum.T_us_ct);
}

Outcome<Assessment> Assessor::assess(Assessment compared, const std::vector<Candidate>& optima,
                                     const Candidate& refined, Run& run) {
  measure_pose(optima.front(), refined, compared.measures);
  if (!plan_.gathers()) return compared;
  if (plan_.gathers_own()) {
    own_.check(refined, compared, run);
    // Evidence that takes long is not worth it for a pose in doubt if the registration goes on.
    if (!plan_.goes_on_as_patient(compared.measures)) own_.settle(optima.front(), compared, run);
    return compared;
  }
  const std::optional<Refusal> refusal = assess_as_patient(refined, compared, run);
  if (refusal) return *refusal;
  return compared;
}

std::optional<Refusal> Assessor::assess_as_patient(const Candidate& refined, Assessment& assessment,
                                                   Run& run) {
  if (!as_patient_) {
    RegistrationOptions options = as_patient(in_.options);
    Outcome<ImagePyramid> images =
        prepare({in_.ultrasound, in_.ct, in_.T_us_ct_initial, options}, run);
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
