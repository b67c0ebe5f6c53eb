#pragma once

#include "us_ct_registration/ultrasound/conditioning.h"

namespace usct {

/// Sets `reasons`, the depth range and the share of beams with a far wall in `result`; see
/// `condition`.
void exclude(const BeamUltrasound& ultrasound, const ConditioningOptions& options,
             ConditionedUltrasound& result);

}  // namespace usct
