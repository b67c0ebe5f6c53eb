#include "us_ct_registration/registration/registration.h"

#include "registration/pipeline.h"

namespace usct {

RegistrationResult register_ultrasound(const BeamUltrasound& ultrasound, const PreparedCt& ct,
                                       const Eigen::Isometry3d& T_us_ct_initial,
                                       const RegistrationOptions& options,
                                       const RegistrationHooks& hooks) {
  return registration::run_pipeline({ultrasound, ct, T_us_ct_initial, options}, hooks).result;
}

}  // namespace usct
