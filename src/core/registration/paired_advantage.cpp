#include "registration/paired_advantage.h"

#include <array>
#include <cmath>
#include <limits>
#include <map>

namespace usct::registration {

double paired_advantage(const std::vector<double>& parts, const std::vector<double>& other,
                        const std::vector<Eigen::Vector3d>& centres_us_mm, double cluster_mm) {
  std::map<std::array<int, 3>, double> clusters;
  double total = 0.0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Eigen::Array3i cube = (centres_us_mm[i].array() / cluster_mm).floor().cast<int>();
    const double difference = parts[i] - other[i];
    clusters[{cube[0], cube[1], cube[2]}] += difference;
    total += difference;
  }
  const auto count = static_cast<double>(clusters.size());
  if (clusters.size() < 2) return std::numeric_limits<double>::quiet_NaN();
  double squares = 0.0;
  for (const auto& [cube, difference] : clusters)
    squares += (difference - total / count) * (difference - total / count);
  const double error = std::sqrt(squares * count / (count - 1.0));
  // Poses that are the same in every part have no advantage.
  return error > 0.0 ? total / error : 0.0;
}

}  // namespace usct::registration
