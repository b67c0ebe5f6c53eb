#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

namespace usct::test {

/// A homogeneous texture: waves of 2-6 mm in random directions.
class Texture {
 public:
  explicit Texture(unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    for (int i = 0; i < 24; ++i) {
      const Eigen::Vector3d direction =
          Eigen::Vector3d(normal(random), normal(random), normal(random));
      waves_.push_back(2.0 * kPi / (2.0 + 4.0 * uniform(random)) * direction.normalized());
      phases_.push_back(2.0 * kPi * uniform(random));
    }
  }
  double at(const Eigen::Vector3d& p_mm) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < waves_.size(); ++i)
      sum += std::sin(waves_[i].dot(p_mm) + phases_[i]);
    return 128.0 + 18.0 * sum;
  }

 private:
  std::vector<Eigen::Vector3d> waves_;
  std::vector<double> phases_;
};

struct SweepCase {
  double lag_s = 0.0;
  double duration_s = 10.0;
  double interval_s = 0.05;
  double noise = 4.0;                      // standard deviation, grey values
  int repeat_every = 0;                    // every n-th image is that of the frame before
  std::function<double(double)> along_mm;  // path length of the probe by time
};

/// Position at an unsteady speed between 2 and 18 mm/s, as by hand.
inline double unsteady_mm(double t) {
  return 10.0 * t - 3.0 * std::cos(1.7 * t) - 1.0 * std::cos(4.1 * t + 1.0);
}

/// Frames of a linear probe, 16 x 10, whose image at time t shows the texture at t - lag.
inline PreScanVolume sweep_of(const SweepCase& how, unsigned seed) {
  const Texture texture(seed);
  std::mt19937 random(seed + 1000);
  std::normal_distribution<double> normal;
  PreScanVolume volume;
  volume.geometry.axial = {16, 0.0, 1.1};
  volume.geometry.array = LinearArray{{-9, -7, -5, -3, -1, 1, 3, 5, 7, 9}};
  TrackedSweep sweep;
  const auto pose = [&](double t) {
    return Eigen::Isometry3d(Eigen::Translation3d(100.0, -40.0, how.along_mm(t)) *
                             Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()));
  };
  for (int i = 0; i * how.interval_s < how.duration_s; ++i) {
    const double t = i * how.interval_s;
    sweep.T_us_frame.push_back(pose(t));
    sweep.frame_times_s.push_back(1000.0 + t);
    const std::size_t pixels = 160;
    if (how.repeat_every > 0 && i % how.repeat_every == 1) {
      const std::vector<std::uint8_t> last(volume.voxels.end() - pixels, volume.voxels.end());
      volume.voxels.insert(volume.voxels.end(), last.begin(), last.end());
      continue;
    }
    for (int line = 0; line < 10; ++line)
      for (int sample = 0; sample < 16; ++sample) {
        const Eigen::Vector3d p_frame(-9.0 + 2.0 * line, 1.1 * sample, 0.0);
        const double grey = texture.at(pose(t - how.lag_s) * p_frame) + how.noise * normal(random);
        volume.voxels.push_back(static_cast<std::uint8_t>(std::clamp(grey, 0.0, 255.0)));
      }
  }
  volume.geometry.motion = sweep;
  return volume;
}

}  // namespace usct::test
