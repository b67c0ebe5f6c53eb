#include "ultrasound/hole_filling.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "parallel.h"
#include "ultrasound/lattice.h"

namespace usct {
namespace {

/// One of each pair of opposite directions to the 26 neighbours.
std::vector<Eigen::Vector3i> half_of_the_neighbours() {
  std::vector<Eigen::Vector3i> directions;
  for (int k = 0; k <= 1; ++k)
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i)
        if (k > 0 || j > 0 || (j == 0 && i > 0)) directions.emplace_back(i, j, k);
  return directions;
}

/// Bridges gaps between known voxels (see CompoundOptions::hole_fill_radius_mm).
class HoleFiller {
 public:
  HoleFiller(const ScanConverted& known, double radius_mm) : known_(known) {
    // No voxel of the grid is farther away, and a large radius exceeds the range of int.
    const double most = grid().size.maxCoeff();
    for (const Eigen::Vector3i& step : half_of_the_neighbours()) {
      const double length_mm = step.cast<double>().cwiseProduct(grid().spacing_mm).norm();
      // A multiple of the length counts, though it may be less by the last bit.
      constexpr double kLastBits = 1e-9;
      directions_.push_back(
          {step, length_mm, static_cast<int>(std::min(radius_mm / length_mm + kLastBits, most))});
    }
  }

  /// The value across the hole at an empty voxel, if known voxels face each other there: over all
  /// directions the mean of the linear interpolations, weighted by the inverse of the gap's width.
  std::optional<float> at(const Eigen::Vector3i& voxel) const {
    double sum = 0.0;
    double weight = 0.0;
    for (const Direction& direction : directions_) {
      const std::optional<Known> ahead = nearest_known(voxel, direction, 1);
      if (!ahead) continue;
      const std::optional<Known> behind = nearest_known(voxel, direction, -1);
      if (!behind) continue;
      const double gap_mm = ahead->distance_mm + behind->distance_mm;
      sum += (ahead->value * behind->distance_mm + behind->value * ahead->distance_mm) /
             (gap_mm * gap_mm);
      weight += 1.0 / gap_mm;
    }
    if (!(weight > 0.0)) return {};
    return static_cast<float>(sum / weight);
  }

 private:
  struct Direction {
    Eigen::Vector3i step;
    double length_mm;
    int reach;  // steps
  };
  struct Known {
    double value;
    double distance_mm;
  };

  const Grid& grid() const { return known_.volume.grid; }

  std::optional<Known> nearest_known(const Eigen::Vector3i& voxel, const Direction& direction,
                                     int sense) const {
    for (int n = 1; n <= direction.reach; ++n) {
      const Eigen::Vector3i at = voxel + sense * n * direction.step;
      if ((at.array() < 0).any() || (at.array() >= grid().size.array()).any()) return {};
      const std::size_t offset = grid().offset(at.x(), at.y(), at.z());
      if (known_.mask.voxels[offset] != 0)
        return Known{static_cast<double>(known_.volume.voxels[offset]), n * direction.length_mm};
    }
    return {};
  }

  const ScanConverted& known_;
  std::vector<Direction> directions_;
};

}  // namespace

ScanConverted with_holes_filled(const ScanConverted& known, double radius_mm) {
  ScanConverted filled = known;
  const HoleFiller filler(known, radius_mm);
  const Grid& grid = known.volume.grid;
  parallel_for(grid.size.z(), [&](int k) {
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        if (known.mask.at(i, j, k) != 0) continue;
        if (const std::optional<float> value = filler.at({i, j, k})) {
          filled.volume.at(i, j, k) = grey(*value);
          filled.mask.at(i, j, k) = 255;
        }
      }
  });
  return filled;
}

}  // namespace usct
