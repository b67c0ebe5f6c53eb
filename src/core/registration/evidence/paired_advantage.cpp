#include "registration/evidence/paired_advantage.h"

#include <cmath>
#include <limits>
#include <numeric>

namespace usct::registration {

double paired_advantage(const std::vector<double>& parts, const std::vector<double>& other,
                        const Clusters& clusters) {
  if (clusters.count() < 2) return std::numeric_limits<double>::quiet_NaN();
  std::vector<double> differences;
  for (std::size_t i = 0; i < parts.size(); ++i) differences.push_back(parts[i] - other[i]);
  const std::vector<double> sums = clusters.sums(differences);
  const auto count = static_cast<double>(sums.size());
  const double total = std::accumulate(sums.begin(), sums.end(), 0.0);
  double squares = 0.0;
  for (const double sum : sums) squares += (sum - total / count) * (sum - total / count);
  const double error = std::sqrt(squares * count / (count - 1.0));
  // Poses that are the same in every part have no advantage.
  return error > 0.0 ? total / error : 0.0;
}

}  // namespace usct::registration
