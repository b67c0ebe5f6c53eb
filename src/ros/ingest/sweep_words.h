#pragma once

#include <string>

#include "us_ct_registration/ultrasound/image_sweep.h"

/// A sweep of live images in words, for logs, diagnostics and the callers of services.
namespace usct::ros_interface {

std::string described(const LagEstimate& lag);
std::string described(const PlacedSweep& placed, const std::string& name);

}  // namespace usct::ros_interface
