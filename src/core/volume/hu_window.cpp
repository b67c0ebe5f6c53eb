#include "us_ct_registration/volume/hu_window.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "require.h"

namespace usct {

void HuWindow::validate(const std::string& source) const {
  using Limits = std::numeric_limits<std::int16_t>;
  const auto is_hu = [](double value) {
    return value >= Limits::min() && value <= Limits::max() && value == std::floor(value);
  };
  require(is_hu(low_hu), source, "low_hu", low_hu, "a whole number within [-32768, 32767]");
  require(is_hu(high_hu), source, "high_hu", high_hu, "a whole number within [-32768, 32767]");
  require(low_hu < high_hu, source, "low_hu", low_hu, "< high_hu");
}

CtVolume limited_to(const HuWindow& window, const CtVolume& ct) {
  window.validate("HU window");
  const auto low = static_cast<std::int16_t>(window.low_hu);
  const auto high = static_cast<std::int16_t>(window.high_hu);
  CtVolume limited = ct;
  for (std::int16_t& voxel : limited.voxels) voxel = std::clamp(voxel, low, high);
  return limited;
}

}  // namespace usct
