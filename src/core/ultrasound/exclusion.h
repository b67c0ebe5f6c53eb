#pragma once

#include "us_ct_registration/ultrasound/conditioning.h"

namespace usct {

/// Fills `reasons`, the depths and the far wall of `result`; see `condition`.
void exclude(const BeamUltrasound& ultrasound, const ConditioningOptions& options,
             ConditionedUltrasound& result);

}  // namespace usct
