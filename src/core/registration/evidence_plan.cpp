#include "registration/evidence_plan.h"

#include <algorithm>

#include "registration/evidence/doubts.h"

namespace usct::registration {
namespace {

/// The starts of `patient`, and as far as those of the options where they reach farther.
StartOptions farther(const StartOptions& of_patient, const std::optional<StartOptions>& own) {
  if (!own || (own->rotation_rad <= of_patient.rotation_rad &&
               own->translation_mm <= of_patient.translation_mm))
    return of_patient;
  StartOptions starts = *own;
  starts.rotation_rad = std::max(starts.rotation_rad, of_patient.rotation_rad);
  starts.translation_mm = std::max(starts.translation_mm, of_patient.translation_mm);
  starts.count = std::max(starts.count, of_patient.count);
  return starts;
}

}  // namespace

bool EvidencePlan::goes_on_as_patient(const Measures& measures) const {
  return may_go_on_as_patient() && !is_beyond_doubt(measures, *limit_);
}

bool EvidencePlan::accepts(const Measures& measures) const {
  return !limit_ || (measures.wrong_probability && *measures.wrong_probability <= *limit_);
}

RegistrationOptions as_patient(const RegistrationOptions& of) {
  RegistrationOptions options;
  ConfidenceOptions confidence = of.confidence;
  // Similarities of evidence on other images belong to those.
  if (confidence.evidence != EvidenceSource::kPatient) {
    confidence.similarity = options.confidence.similarity;
    confidence.ridge_similarity = options.confidence.ridge_similarity;
  }
  confidence.evidence = EvidenceSource::kOwn;
  options.confidence = confidence;
  options.search.starts = farther(*options.search.starts, of.search.starts);
  options.search.rounds = of.search.rounds;
  options.correct_sweep = of.correct_sweep;
  options.seed = of.seed;
  return options;
}

}  // namespace usct::registration
