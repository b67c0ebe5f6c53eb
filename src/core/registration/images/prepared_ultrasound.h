#pragma once

#include <memory>
#include <optional>

#include "registration/images/field_points.h"
#include "us_ct_registration/progress.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct::registration {

/// The ultrasound for all levels: conditioned, and `known` at the samples that count.
struct PreparedUltrasound {
  std::shared_ptr<const BeamUltrasound> us;
  /// An even selection of the positions of samples that count.
  FieldPoints field;
};

/// Conditions the ultrasound. `check` may throw to cancel.
PreparedUltrasound prepare_ultrasound(const BeamUltrasound& ultrasound,
                                      const RegistrationOptions& options, const Check& check = {});

/// The ultrasound averaged to about this spacing, mm; unset if it has this spacing already.
std::optional<BeamUltrasound> averaged_to(const BeamUltrasound& us,
                                          const std::optional<double>& spacing_mm);

}  // namespace usct::registration
