#pragma once

#include <string>

#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Range of CT values that a similarity uses. Outside are air, bone and metal, whose steps of
/// hundreds of HU would outweigh all soft tissue.
struct HuWindow {
  double low_hu = -150.0;
  double high_hu = 400.0;

  /// Throws InputError, naming `source`, unless low < high, both whole and within [-32768, 32767].
  void validate(const std::string& source) const;
};

/// The CT with its values clamped to the window. Throws InputError if the window is invalid.
CtVolume limited_to(const HuWindow& window, const CtVolume& ct);

}  // namespace usct
