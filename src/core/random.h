#pragma once

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <cstdint>

/// Random numbers as functions of seed, purpose and place. They have no state, so that a value does
/// not depend on the thread that computes it or on the order.
namespace usct {

/// SplitMix64's finaliser (Steele, Lea, Flood 2014): a bijection in which every bit of the input
/// changes about half the bits of the output.
inline std::uint64_t mix(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

inline std::uint64_t hash(std::uint64_t seed, std::uint64_t a) { return mix(seed ^ mix(a)); }
/// Keys are distinct for coordinates within +-2^20.
inline std::uint64_t lattice_key(std::int64_t i, std::int64_t j, std::int64_t k) {
  const auto bits = [](std::int64_t v) { return static_cast<std::uint64_t>(v) & 0x1FFFFFULL; };
  return bits(i) | (bits(j) << 21U) | (bits(k) << 42U);
}
inline std::uint64_t hash(std::uint64_t seed, std::int64_t i, std::int64_t j, std::int64_t k) {
  return mix(seed ^ mix(lattice_key(i, j, k)));
}

/// A number that is uniform in [0, 1).
inline double uniform(std::uint64_t h) { return static_cast<double>(h >> 11U) * 0x1.0p-53; }

/// Two independent normal numbers (Box and Muller), as one complex number with E|z|^2 = 2.
inline std::complex<double> normal_pair(std::uint64_t h) {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(h)));
  const double angle = 6.283185307179586 * uniform(mix(h));
  return {radius * std::cos(angle), radius * std::sin(angle)};
}
inline double normal(std::uint64_t h) { return normal_pair(h).real(); }

/// A sequence of random numbers for building things one after the other (never across threads).
class Sequence {
 public:
  explicit Sequence(std::uint64_t seed, std::uint64_t purpose) : seed_(hash(seed, purpose)) {}

  std::uint64_t next() { return hash(seed_, count_++); }
  double between(double low, double high) { return low + (high - low) * uniform(next()); }
  double gaussian(double mean, double sigma) { return mean + sigma * normal(next()); }
  Eigen::Vector3d direction() {
    const double z = between(-1.0, 1.0);
    const double angle = between(0.0, 6.283185307179586);
    const double r = std::sqrt(1.0 - z * z);
    return {r * std::cos(angle), r * std::sin(angle), z};
  }

 private:
  std::uint64_t seed_;
  std::uint64_t count_ = 0;
};

/// Smooth noise with mean 0 and standard deviation about 1, correlated over about one unit of `p`.
inline double smooth_noise(std::uint64_t seed, const Eigen::Vector3d& p) {
  const Eigen::Vector3d cell = p.array().floor();
  const Eigen::Vector3d f = p - cell;
  const Eigen::Vector3d w = f.array() * f.array() * (3.0 - 2.0 * f.array());
  const auto i = static_cast<std::int64_t>(cell.x());
  const auto j = static_cast<std::int64_t>(cell.y());
  const auto k = static_cast<std::int64_t>(cell.z());
  const auto along_x = [&](int b, int c) {
    const double low = uniform(mix(seed + lattice_key(i, j + b, k + c)));
    return low + w.x() * (uniform(mix(seed + lattice_key(i + 1, j + b, k + c))) - low);
  };
  const auto along_xy = [&](int c) {
    const double low = along_x(0, c);
    return low + w.y() * (along_x(1, c) - low);
  };
  const double low = along_xy(0);
  const double sum = 2.0 * (low + w.z() * (along_xy(1) - low)) - 1.0;
  // A corner is uniform in [-1, 1); the mean over a cell of the summed squared weights is 0.41.
  constexpr double kToUnitVariance = 2.7;
  return kToUnitVariance * sum;
}

}  // namespace usct
