#include "registration/sweep_correction.h"

#include "registration/evidence/acquisition_check.h"

namespace usct::registration {
namespace {

bool have_same_similarity(const Registration& a, const Registration& b) {
  return a.by_matched_blocks == b.by_matched_blocks && a.by_patient == b.by_patient;
}

}  // namespace

bool shows_right_sweep(const Outcome<Registration>& corrected) {
  return corrected && corrected->result.status == RegistrationStatus::kRegistered &&
         !shown_errors(corrected->result.measures).has_wrong_sweep();
}

bool correction_holds(const Registration& recorded, const Outcome<Registration>& corrected) {
  if (!shows_right_sweep(corrected)) return false;
  return !have_same_similarity(recorded, *corrected) ||
         corrected->result.similarity > recorded.result.similarity;
}

}  // namespace usct::registration
