#include "registration/evidence/clusters.h"

#include <algorithm>
#include <array>
#include <unordered_map>

namespace usct::registration {
namespace {

using Cube = std::array<int, 3>;

struct HashOfCube {
  std::size_t operator()(const Cube& cube) const {
    std::size_t hash = 0;
    for (const int i : cube) hash = hash * 1000003U + static_cast<unsigned>(i);
    return hash;
  }
};

using Numbers = std::unordered_map<Cube, std::size_t, HashOfCube>;

std::vector<std::size_t> neighbours_of(const Cube& cube, const Numbers& numbers) {
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
  std::vector<Cube> cubes;  // in the order in which they are met, until they are sorted
  Numbers numbers;
  of_.reserve(centres_us_mm.size());
  for (const Eigen::Vector3d& centre : centres_us_mm) {
    const Eigen::Array3i at = (centre.array() / edge_mm).floor().cast<int>();
    const auto [met, is_new] = numbers.try_emplace({at[0], at[1], at[2]}, cubes.size());
    if (is_new) cubes.push_back(met->first);
    of_.push_back(met->second);
  }
  const std::vector<Cube> as_met = cubes;
  std::sort(cubes.begin(), cubes.end());
  for (std::size_t i = 0; i < cubes.size(); ++i) numbers[cubes[i]] = i;
  for (std::size_t& number : of_) number = numbers[as_met[number]];
  for (const Cube& cube : cubes) {
    middles_us_mm_.push_back(edge_mm * (Eigen::Array3d(cube[0], cube[1], cube[2]) + 0.5));
    neighbours_.push_back(neighbours_of(cube, numbers));
  }
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
