#include "registration/verdict.h"

namespace usct::registration {

RegistrationResult result_of(const std::vector<Candidate>& optima, const Candidate& refined,
                             const Assessment& assessment,
                             const std::optional<GateFailure>& failure) {
  RegistrationResult result;
  result.similarity = optima.front().value;
  result.overlap = refined.overlap;
  result.covariance = assessment.covariance;
  result.measures = assessment.measures;
  // The first candidate is the pose that is judged, after its refinement.
  result.candidates.push_back({refined.T_us_ct, optima.front().value, refined.overlap});
  for (std::size_t i = 1; i < optima.size(); ++i)
    result.candidates.push_back({optima[i].T_us_ct, optima[i].value, optima[i].overlap});
  if (failure) {
    result.status =
        failure->no_overlap ? RegistrationStatus::kNoOverlap : RegistrationStatus::kLowConfidence;
    result.message = failure->message;
  } else {
    result.status = RegistrationStatus::kRegistered;
    result.message = "all gates passed";
    result.T_us_ct = refined.T_us_ct;
  }
  return result;
}

RegistrationResult result_of(const Refusal& refusal) {
  RegistrationResult result;
  result.status = refusal.status;
  result.message = refusal.message;
  return result;
}

}  // namespace usct::registration
