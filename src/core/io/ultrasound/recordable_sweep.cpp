#include "io/ultrasound/recordable_sweep.h"

#include <cmath>
#include <vector>

#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::io {

double recordable_pitch_rad(const PreScanVolume& volume, const std::filesystem::path& path) {
  constexpr double kEven_rad = 0.5e-3 * kDegree;
  const std::string format = "a " + path.extension().string() + " file holds ";
  const auto* sweep = std::get_if<MotorSweep>(&volume.geometry.motion);
  if (!sweep) throw InputError(path.string(), format + "motorised sweeps, not tracked ones");
  const std::vector<double>& angles_rad = sweep->frame_angles_rad;
  const double pitch =
      (angles_rad.back() - angles_rad.front()) / static_cast<double>(angles_rad.size() - 1);
  for (std::size_t i = 1; i < angles_rad.size(); ++i)
    if (std::abs(angles_rad[i] - angles_rad[i - 1] - pitch) > kEven_rad)
      throw InputError(path.string(), format + "one angle between frames, but step " +
                                          std::to_string(i) +
                                          " of this sweep differs from the mean");
  return pitch;
}

int truncated_millidegrees(double angle_rad) {
  constexpr double kAllowance = 1e-6;  // for rounding, such as that of 0.731 * 1000
  return static_cast<int>(std::floor(1000.0 * degrees(angle_rad) + kAllowance));
}

}  // namespace usct::io
