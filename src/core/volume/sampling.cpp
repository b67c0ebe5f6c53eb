#include "us_ct_registration/volume/sampling.h"

#include <algorithm>
#include <limits>

namespace usct {

template <typename T>
float sample_at_index(const Volume<T>& volume, const Eigen::Vector3d& index,
                      Interpolation interpolation, Outside outside) {
  if (!contains_index(volume.grid, index)) {
    if (outside.kind == Outside::Kind::kConstant) return outside.constant_value;
    if (index.hasNaN()) return std::numeric_limits<float>::quiet_NaN();
  }
  const Eigen::Vector3i& size = volume.grid.size;
  const Eigen::Vector3d clamped =
      index.cwiseMax(0.0).cwiseMin((size - Eigen::Vector3i::Ones()).cast<double>());
  if (interpolation == Interpolation::kNearest) {
    const Eigen::Vector3i n = (clamped.array() + 0.5).floor().cast<int>();
    return static_cast<float>(volume.at(n.x(), n.y(), n.z()));
  }
  const Eigen::Vector3i lower = clamped.array().floor().cast<int>();
  const Eigen::Vector3i upper =
      (lower + Eigen::Vector3i::Ones()).cwiseMin(size - Eigen::Vector3i::Ones());
  const Eigen::Vector3f w = (clamped - lower.cast<double>()).cast<float>();
  const auto along_x = [&](int j, int k) {
    const auto a = static_cast<float>(volume.at(lower.x(), j, k));
    const auto b = static_cast<float>(volume.at(upper.x(), j, k));
    return a + w.x() * (b - a);
  };
  const float low = along_x(lower.y(), lower.z()) +
                    w.y() * (along_x(upper.y(), lower.z()) - along_x(lower.y(), lower.z()));
  const float high = along_x(lower.y(), upper.z()) +
                     w.y() * (along_x(upper.y(), upper.z()) - along_x(lower.y(), upper.z()));
  return low + w.z() * (high - low);
}

template float sample_at_index(const Volume<std::uint8_t>&, const Eigen::Vector3d&, Interpolation,
                               Outside);
template float sample_at_index(const Volume<std::int16_t>&, const Eigen::Vector3d&, Interpolation,
                               Outside);
template float sample_at_index(const Volume<std::uint16_t>&, const Eigen::Vector3d&, Interpolation,
                               Outside);
template float sample_at_index(const Volume<float>&, const Eigen::Vector3d&, Interpolation,
                               Outside);

}  // namespace usct
