#include "phantom/tissue_look.h"

#include <algorithm>
#include <cmath>

#include "random.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;

Vector3d base_colour(Tissue tissue) {
  switch (tissue) {
    case Tissue::kTumour:
      return {0.66, 0.46, 0.28};
    case Tissue::kCyst:
      return {0.42, 0.40, 0.45};
    case Tissue::kArtery:
      return {0.62, 0.16, 0.12};
    case Tissue::kVein:
      return {0.26, 0.13, 0.24};
    case Tissue::kFat:
    case Tissue::kSinusFat:
      return {0.80, 0.47, 0.17};
    case Tissue::kUrine:
      return {0.70, 0.52, 0.40};
    default:
      return {0.44, 0.13, 0.09};
  }
}

/// 1 on the lines at which a smooth noise is 0, falling to 0 at `width` beside them: a net of
/// lines.
double net(std::uint64_t seed, const Vector3d& p, double width) {
  return std::max(0.0, 1.0 - std::abs(smooth_noise(seed, p)) / width);
}

}  // namespace

Look look_of(Tissue tissue, const Vector3d& p_mm, std::uint64_t seed) {
  const std::uint64_t own = hash(seed, static_cast<std::uint64_t>(tissue));
  const double coarse = smooth_noise(own, p_mm / 9.0);
  const double fine = smooth_noise(own + 1, p_mm / 1.7);
  const double grain = smooth_noise(own + 2, p_mm / 0.55);
  Look look{
      base_colour(tissue) * std::clamp(1.0 + 0.10 * coarse + 0.07 * fine + 0.05 * grain, 0.5, 1.5),
      0.5};
  // Vessels curl: their pattern is evaluated at points that a coarser noise has moved.
  const Vector3d curled = p_mm + 1.6 * Vector3d(fine, smooth_noise(own + 3, p_mm / 4.0), coarse);
  const Vector3d blood(0.36, 0.04, 0.04);
  double vessels = 0.0;
  switch (tissue) {
    case Tissue::kTumour:
      vessels = 0.75 * net(own + 4, curled / 5.0, 0.16);
      look.colour += 0.05 * coarse * Vector3d(1.0, -0.4, -0.6);
      break;
    case Tissue::kCortex:
    case Tissue::kMedulla:
      vessels = 0.45 * net(own + 4, curled / 8.0, 0.12);
      look.gloss = 0.7;
      break;
    case Tissue::kFat:
      // Lobules are parted by darker furrows.
      vessels = 0.35 * net(own + 4, curled / 11.0, 0.08);
      look.colour *= 1.0 - 0.2 * net(own + 5, p_mm / 4.5, 0.35);
      look.gloss = 0.4;
      break;
    default:
      break;
  }
  look.colour += vessels * (blood - look.colour);
  return look;
}

}  // namespace usct::phantom
