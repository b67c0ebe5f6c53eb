#pragma once

#include <memory>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/sweep_assembly.h"

namespace usct {

/// Makes the volume of a whole sweep: decides which frames it keeps, and their positions. `frames`
/// are valid, of one sweep and sorted by index; at least one. Adds frames that it leaves out to
/// `dropped`. Throws InputError, naming `source`, if stamps fall, the motor turns back, its travel
/// changes, or no frame is left; and as PreScanVolume::validate.
AssembledSweep volume_of_sweep(const std::vector<std::shared_ptr<const StreamedFrame>>& frames,
                               double image_lag_s, const std::string& source, Counts& dropped);

}  // namespace usct
