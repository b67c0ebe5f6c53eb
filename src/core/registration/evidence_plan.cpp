#include "registration/evidence_plan.h"

#include "registration/evidence/doubts.h"

namespace usct::registration {

bool EvidencePlan::goes_on_as_patient(const Measures& measures) const {
  return may_go_on_as_patient() && !is_beyond_doubt(measures, *limit_);
}

bool EvidencePlan::accepts(const Measures& measures) const {
  return !limit_ || (measures.wrong_probability && *measures.wrong_probability <= *limit_);
}

}  // namespace usct::registration
