#include "registration/clusters.h"

#include <array>
#include <map>

namespace usct::registration {
namespace {

using Cube = std::array<int, 3>;

std::vector<std::size_t> neighbours_of(const Cube& cube,
                                       const std::map<Cube, std::size_t>& numbers) {
  std::vector<std::size_t> neighbours;
  for (const int x : {-1, 0, 1})
    for (const int y : {-1, 0, 1})
      for (const int z : {-1, 0, 1}) {
        const auto found = numbers.find({cube[0] + x, cube[1] + y, cube[2] + z});
        if (found != numbers.end() && found->first != cube) neighbours.push_back(found->second);
      }
  return neighbours;
}

}  // namespace

Clusters::Clusters(const std::vector<Eigen::Vector3d>& centres_us_mm, double edge_mm) {
  std::vector<Cube> cubes;
  std::map<Cube, std::size_t> numbers;
  for (const Eigen::Vector3d& centre : centres_us_mm) {
    const Eigen::Array3i cube = (centre.array() / edge_mm).floor().cast<int>();
    cubes.push_back({cube[0], cube[1], cube[2]});
    numbers[cubes.back()] = 0;
  }
  for (auto& [cube, number] : numbers) {
    number = middles_us_mm_.size();
    middles_us_mm_.push_back(edge_mm * (Eigen::Array3d(cube[0], cube[1], cube[2]) + 0.5));
  }
  for (const auto& [cube, number] : numbers) neighbours_.push_back(neighbours_of(cube, numbers));
  for (const Cube& cube : cubes) of_.push_back(numbers[cube]);
}

std::vector<double> Clusters::sums(const std::vector<double>& parts) const {
  std::vector<double> sums(count());
  for (std::size_t i = 0; i < parts.size(); ++i) sums[of_[i]] += parts[i];
  return sums;
}

std::vector<double> Clusters::sums_of_neighbours(const std::vector<double>& sums) const {
  std::vector<double> result(count());
  for (std::size_t c = 0; c < count(); ++c)
    for (const std::size_t neighbour : neighbours_[c]) result[c] += sums[neighbour];
  return result;
}

}  // namespace usct::registration
