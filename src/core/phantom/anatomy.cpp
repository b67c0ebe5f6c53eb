#include "us_ct_registration/phantom/anatomy.h"

#include <algorithm>
#include <cmath>

#include "phantom/random.h"

namespace usct::phantom {

Eigen::Vector3d Anatomy::texture_point_mm(const Eigen::Vector3d& p_ct_mm, Tissue) const {
  return p_ct_mm;
}

Texture texture_at(const Anatomy& anatomy, const TissueProperties& properties, Tissue tissue,
                   const Eigen::Vector3d& p_ct_mm, std::uint64_t seed) {
  Texture texture;
  const bool varies = properties.texture_db > 0.0 || properties.hu_texture > 0.0;
  const bool has_sheets = properties.septa_db > 0.0;
  if (!varies && !has_sheets) return texture;
  const std::array<double, 3>& scale = properties.texture_mm;
  const Eigen::Vector3d q = anatomy.texture_point_mm(p_ct_mm, tissue)
                                .cwiseQuotient(Eigen::Vector3d(scale[0], scale[1], scale[2]));
  const std::uint64_t stream = hash(seed, 0x7E87 + static_cast<std::uint64_t>(tissue));
  if (varies)
    texture.smooth = 0.85 * smooth_noise(stream, q) + 0.53 * smooth_noise(mix(stream), 2.3 * q);
  if (has_sheets) {
    // Zero crossings of a smooth field are thin sheets that branch and close like septa.
    constexpr double kSheetWidth = 0.22;
    const double ridge = std::abs(smooth_noise(hash(stream, 7), q)) / kSheetWidth;
    texture.sheet = std::max(0.0, 1.0 - ridge);
  }
  return texture;
}

}  // namespace usct::phantom
