#include "registration/evidence_plan.h"

namespace usct::registration {

bool EvidencePlan::accepts(const Measures& measures) const {
  return !limit_ || (measures.wrong_probability && *measures.wrong_probability <= *limit_);
}

}  // namespace usct::registration
