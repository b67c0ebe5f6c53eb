#include "registration/local_agreement.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "parallel.h"
#include "registration/candidates.h"
#include "registration/clusters.h"

namespace usct::registration {
namespace {

/// The shared pose first.
std::vector<Eigen::Vector3d> translations(double step_mm) {
  std::vector<Eigen::Vector3d> result{Eigen::Vector3d::Zero()};
  for (const double x : {-step_mm, 0.0, step_mm})
    for (const double y : {-step_mm, 0.0, step_mm})
      for (const double z : {-step_mm, 0.0, step_mm})
        if (x != 0.0 || y != 0.0 || z != 0.0) result.emplace_back(x, y, z);
  return result;
}

}  // namespace

std::optional<double> local_agreement(const Similarity& similarity,
                                      const Eigen::Isometry3d& T_us_ct, double cluster_mm,
                                      double step_mm, Run& run) {
  const Clusters clusters(similarity.part_centres_us_mm(), cluster_mm);
  if (clusters.count() == 0) return std::nullopt;
  const std::vector<Eigen::Vector3d> moves_mm = translations(step_mm);
  std::vector<std::vector<double>> values(moves_mm.size());
  parallel_for(static_cast<int>(moves_mm.size()), [&](int i) {
    run.check_cancelled();
    const auto at = static_cast<std::size_t>(i);
    const Candidate moved{Eigen::Translation3d(moves_mm[at]) * T_us_ct, {}};
    values[at] = clusters.sums(similarity.parts(moved.pose()));
  });
  run.count_evaluations(moves_mm.size());
  double reached = 0.0;
  double reachable = 0.0;
  for (std::size_t c = 0; c < clusters.count(); ++c) {
    double sum = 0.0;
    double most = values[0][c];
    for (const std::vector<double>& of_move : values) {
      sum += of_move[c];
      most = std::max(most, of_move[c]);
    }
    const double mean = sum / static_cast<double>(values.size());
    reached += values[0][c] - mean;
    reachable += most - mean;
  }
  if (!(reachable > 0.0)) return std::nullopt;
  return reached / reachable - 1.0 / std::sqrt(static_cast<double>(clusters.count()));
}

}  // namespace usct::registration
