#include "registration/clusters.h"

#include <array>
#include <map>

namespace usct::registration {

Clusters::Clusters(const std::vector<Eigen::Vector3d>& centres_us_mm, double edge_mm) {
  std::vector<std::array<int, 3>> cubes;
  std::map<std::array<int, 3>, std::size_t> numbers;
  for (const Eigen::Vector3d& centre : centres_us_mm) {
    const Eigen::Array3i cube = (centre.array() / edge_mm).floor().cast<int>();
    cubes.push_back({cube[0], cube[1], cube[2]});
    numbers[cubes.back()] = 0;
  }
  for (auto& [cube, number] : numbers) number = count_++;
  for (const std::array<int, 3>& cube : cubes) of_.push_back(numbers[cube]);
}

std::vector<double> Clusters::sums(const std::vector<double>& parts) const {
  std::vector<double> sums(count_);
  for (std::size_t i = 0; i < parts.size(); ++i) sums[of_[i]] += parts[i];
  return sums;
}

}  // namespace usct::registration
