#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace usct::registration {

/// Cubes of the field of view in which parts of a similarity are added up, since the contributions
/// of neighbouring parts are not independent.
class Clusters {
 public:
  /// `centres_us_mm` are the positions of the parts, `edge_mm` is that of the cubes.
  Clusters(const std::vector<Eigen::Vector3d>& centres_us_mm, double edge_mm);

  std::size_t count() const { return count_; }
  /// The sums of the clusters, in an order that only depends on the positions.
  std::vector<double> sums(const std::vector<double>& parts) const;

 private:
  std::size_t count_ = 0;
  /// The cluster of each part.
  std::vector<std::size_t> of_;
};

}  // namespace usct::registration
