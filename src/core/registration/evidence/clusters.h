#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace usct::registration {

/// Cubes of the field of view in which parts of a similarity are added up, since the contributions
/// of neighbouring parts are not independent.
class Clusters {
 public:
  /// No cluster.
  Clusters() = default;
  /// `centres_us_mm` are the positions of the parts, `edge_mm` is that of the cubes.
  Clusters(const std::vector<Eigen::Vector3d>& centres_us_mm, double edge_mm);

  std::size_t count() const { return middles_us_mm_.size(); }
  /// The middles of the cubes, in an order that only depends on the positions.
  const std::vector<Eigen::Vector3d>& middles_us_mm() const { return middles_us_mm_; }
  /// The sums of the clusters.
  std::vector<double> sums(const std::vector<double>& parts) const;
  /// For each cluster the sum over those whose cubes touch its cube, of which there are 26 at most,
  /// without itself.
  std::vector<double> sums_of_neighbours(const std::vector<double>& sums) const;

 private:
  std::vector<Eigen::Vector3d> middles_us_mm_;
  /// The cluster of each part.
  std::vector<std::size_t> of_;
  std::vector<std::vector<std::size_t>> neighbours_;
};

}  // namespace usct::registration
