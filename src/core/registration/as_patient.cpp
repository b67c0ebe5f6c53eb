#include "registration/as_patient.h"

#include <algorithm>

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
