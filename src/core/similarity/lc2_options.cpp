#include "us_ct_registration/similarity/lc2_options.h"

#include "require.h"

namespace usct {

void Lc2Options::validate(const std::string& source) const {
  require(std::isfinite(ridge_intensity_hu) && ridge_intensity_hu >= 0.0, source,
          "ridge_intensity_hu", ridge_intensity_hu, "finite and >= 0");
  require(std::isfinite(ridge_gradient_hu_per_mm) && ridge_gradient_hu_per_mm >= 0.0, source,
          "ridge_gradient_hu_per_mm", ridge_gradient_hu_per_mm, "finite and >= 0");
}

}  // namespace usct
