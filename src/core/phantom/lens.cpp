#include "phantom/lens.h"

#include "us_ct_registration/error.h"

namespace usct::phantom {
namespace {

using Eigen::Vector2d;

constexpr int kMostInversionSteps = 100;
constexpr double kConverged = 1e-9;
constexpr double kMostErrorPx = 1e-4;

struct Brown {
  double radial;
  Vector2d tangential;
};

Brown distortion_at(const Vector2d& at, const CameraIntrinsics& lens) {
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6] = lens.distortion;
  const double square = at.squaredNorm();
  const double product = 2.0 * at.x() * at.y();
  return {1.0 + square * (k1 + square * (k2 + square * k3)),
          {p1 * product + p2 * (square + 2.0 * at.x() * at.x()),
           p2 * product + p1 * (square + 2.0 * at.y() * at.y())}};
}

}  // namespace

std::vector<Eigen::Vector2f> lines_of_sight(const CameraIntrinsics& lens) {
  std::vector<Eigen::Vector2f> lines;
  lines.reserve(static_cast<std::size_t>(lens.width) * static_cast<std::size_t>(lens.height));
  for (int y = 0; y < lens.height; ++y)
    for (int x = 0; x < lens.width; ++x) {
      const Vector2d wanted((x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy);
      Vector2d at = wanted;
      for (int step = 0; step < kMostInversionSteps; ++step) {
        const Brown brown = distortion_at(at, lens);
        const Vector2d before = at;
        at = (wanted - brown.tangential) / brown.radial;
        if ((at - before).norm() < kConverged) break;
      }
      const Brown brown = distortion_at(at, lens);
      if (!((brown.radial * at + brown.tangential - wanted).norm() * lens.fx < kMostErrorPx))
        throw InputError("endoscope options",
                         "'distortion' is too strong: it cannot be inverted at the pixel (" +
                             std::to_string(x) + ", " + std::to_string(y) + ")");
      lines.push_back(at.cast<float>());
    }
  return lines;
}

}  // namespace usct::phantom
