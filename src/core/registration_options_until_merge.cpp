// Stands in for the validation that registration/ brings; goes when that is merged.
#include "us_ct_registration/error.h"
#include "us_ct_registration/registration/registration.h"

namespace usct {

__attribute__((weak)) void StageOptions::validate(const std::string& source) const {
  if (!(spacing_mm > 0.0)) throw InputError(source, "'spacing_mm' must be > 0");
  if (optimised < 1) throw InputError(source, "'optimised' must be >= 1");
  if (kept < 1) throw InputError(source, "'kept' must be >= 1");
}

__attribute__((weak)) void RegistrationOptions::validate(const std::string& source) const {
  if (stages.empty()) throw InputError(source, "'stages' is empty, must have one at least");
}

}  // namespace usct
