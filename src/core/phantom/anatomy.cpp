#include "us_ct_registration/phantom/anatomy.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "random.h"

namespace usct::phantom {
namespace {

Eigen::Vector3d scaled_texture_point(const Anatomy& anatomy, const TissueProperties& properties,
                                     Tissue tissue, const Eigen::Vector3d& p_ct_mm) {
  const std::array<double, 3>& scale = properties.texture_mm;
  return anatomy.texture_point_mm(p_ct_mm, tissue)
      .cwiseQuotient(Eigen::Vector3d(scale[0], scale[1], scale[2]));
}

std::uint64_t texture_stream(std::uint64_t seed, Tissue tissue) {
  return hash(seed, 0x7E87 + static_cast<std::uint64_t>(tissue));
}

}  // namespace

Eigen::Vector3d Anatomy::texture_point_mm(const Eigen::Vector3d& p_ct_mm, Tissue) const {
  return p_ct_mm;
}

double texture_at(const Anatomy& anatomy, const TissueProperties& properties, Tissue tissue,
                  const Eigen::Vector3d& p_ct_mm, std::uint64_t seed) {
  const Eigen::Vector3d q = scaled_texture_point(anatomy, properties, tissue, p_ct_mm);
  const std::uint64_t stream = texture_stream(seed, tissue);
  return 0.85 * smooth_noise(stream, q) + 0.53 * smooth_noise(mix(stream), 2.3 * q);
}

double sheet_at(const Anatomy& anatomy, const TissueProperties& properties, Tissue tissue,
                const Eigen::Vector3d& p_ct_mm, std::uint64_t seed) {
  // Zero crossings of a smooth field are thin sheets that branch and close like septa.
  constexpr double kSheetWidth = 0.22;
  const Eigen::Vector3d q = scaled_texture_point(anatomy, properties, tissue, p_ct_mm);
  const double field = smooth_noise(hash(texture_stream(seed, tissue), 7), q);
  return std::max(0.0, 1.0 - std::abs(field) / kSheetWidth);
}

double echo_texture_at(Tissue tissue, const Eigen::Vector3d& p_ct_mm, std::uint64_t seed) {
  constexpr std::array<double, 2> kCorrelationMm = {3.0, 10.0};
  const std::uint64_t stream = hash(seed, 0xEC40 + static_cast<std::uint64_t>(tissue));
  double sum = 0.0;
  for (std::size_t i = 0; i < kCorrelationMm.size(); ++i)
    sum += smooth_noise(hash(stream, i), p_ct_mm / kCorrelationMm[i]);
  return sum / std::sqrt(static_cast<double>(kCorrelationMm.size()));
}

}  // namespace usct::phantom
