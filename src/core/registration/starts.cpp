#include "us_ct_registration/registration/starts.h"

#include <boost/random/sobol.hpp>
#include <cmath>

#include "require.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct {
namespace {

/// The next point of the sequence, in [0, 1)^6.
PoseVector next_point(boost::random::sobol& sequence) {
  PoseVector point;
  for (double& value : point) value = std::ldexp(static_cast<double>(sequence() >> 11U), -53);
  return point;
}

Eigen::Vector3d direction(double height, double turn) {
  const double z = 2.0 * height - 1.0;
  const double radius = std::sqrt(1.0 - z * z);
  return {radius * std::cos(2.0 * kPi * turn), radius * std::sin(2.0 * kPi * turn), z};
}

/// The angle below which a fraction of the rotations up to `largest_rad` lies; the angle of uniform
/// rotations has the density 1 - cos.
double angle_of_uniform_rotation(double fraction, double largest_rad) {
  const double area = fraction * (largest_rad - std::sin(largest_rad));
  double low = 0.0;
  double high = largest_rad;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (middle - std::sin(middle) < area ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

PoseVector start(const PoseParameters& pose, const StartOptions& options, const PoseVector& u) {
  if (options.region == StartRegion::kBox) {
    const PoseVector signed_u = 2.0 * u - PoseVector::Ones();
    return pose.parameters_of_motion(options.rotation_rad * signed_u.head<3>(),
                                     options.translation_mm * signed_u.tail<3>());
  }
  return pose.parameters_of_motion(
      angle_of_uniform_rotation(u[0], options.rotation_rad) * direction(u[1], u[2]),
      options.translation_mm * std::cbrt(u[3]) * direction(u[4], u[5]));
}

}  // namespace

void StartOptions::validate(const std::string& source) const {
  constexpr int kMostStarts = 1000000;         // of some hundred bytes each
  constexpr double kMostTranslationMm = 1000;  // no CT reaches farther
  require_within(source, "count", count, 1, kMostStarts);
  require_within(source, "rotation_rad", rotation_rad, 0.0,
                 region == StartRegion::kBox ? kPi / std::sqrt(3.0) : kPi);
  require_within(source, "translation_mm", translation_mm, 0.0, kMostTranslationMm);
}

std::vector<PoseVector> spread_starts(const PoseParameters& pose, const StartOptions& options,
                                      std::size_t first) {
  options.validate("start options");
  std::vector<PoseVector> starts;
  // The sequence's own first point, which is not its start, is the middle as well.
  if (first == 0) starts.push_back(PoseVector::Zero());
  boost::random::sobol sequence(6);
  sequence.discard(6 * std::max<std::size_t>(1, first));
  while (starts.size() < static_cast<std::size_t>(options.count))
    starts.push_back(start(pose, options, next_point(sequence)));
  return starts;
}

}  // namespace usct
