#include "registration/evidence/local_agreement.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "parallel.h"
#include "registration/evidence/clusters.h"
#include "registration/search/candidates.h"

namespace usct::registration {
namespace {

using Eigen::Vector3d;

/// Values of clusters: a row per translation.
using Rows = std::vector<std::vector<double>>;

/// The shared pose first.
std::vector<Vector3d> translations(double step_mm) {
  std::vector<Vector3d> result{Vector3d::Zero()};
  for (const double x : {-step_mm, 0.0, step_mm})
    for (const double y : {-step_mm, 0.0, step_mm})
      for (const double z : {-step_mm, 0.0, step_mm})
        if (x != 0.0 || y != 0.0 || z != 0.0) result.emplace_back(x, y, z);
  return result;
}

/// The translation that a cluster likes best, the first of equal ones, and the rise from the mean.
struct Best {
  std::size_t translation = 0;
  double mean = 0.0;
  double rise = 0.0;
};

Best best_of(const Rows& values, std::size_t cluster) {
  Best best;
  for (std::size_t t = 0; t < values.size(); ++t) {
    best.mean += values[t][cluster] / static_cast<double>(values.size());
    if (values[t][cluster] > values[best.translation][cluster]) best.translation = t;
  }
  best.rise = values[best.translation][cluster] - best.mean;
  return best;
}

std::optional<double> share_of_rise(const Rows& own, const Rows& of_neighbours) {
  const std::size_t clusters = own.front().size();
  double shared = 0.0;
  double as_neighbours = 0.0;
  double reachable = 0.0;
  for (std::size_t c = 0; c < clusters; ++c) {
    const Best best = best_of(own, c);
    shared += own[0][c] - best.mean;
    as_neighbours += own[best_of(of_neighbours, c).translation][c] - best.mean;
    reachable += best.rise;
  }
  if (!(reachable > 0.0)) return std::nullopt;
  return 0.5 * (shared + as_neighbours) / reachable -
         1.0 / std::sqrt(static_cast<double>(clusters));
}

/// By how many of their own errors the gains of the shared pose over the mean exceed 0.
double advantage_of_shared(const Rows& own) {
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t c = 0; c < own.front().size(); ++c) {
    const double gain = own[0][c] - best_of(own, c).mean;
    sum += gain;
    squares += gain * gain;
  }
  return squares > 0.0 ? sum / std::sqrt(squares) : 0.0;
}

/// The sums of each cluster and its neighbours, a row per translation.
Rows sums_of(Rows own, const Rows& of_neighbours) {
  for (std::size_t t = 0; t < own.size(); ++t)
    for (std::size_t c = 0; c < own[t].size(); ++c) own[t][c] += of_neighbours[t][c];
  return own;
}

/// Whether the middle of each cluster's cube is in the region.
std::vector<bool> are_in(const TissueRegion& region, const Clusters& clusters) {
  std::vector<bool> inside;
  for (const Vector3d& middle_us_mm : clusters.middles_us_mm())
    inside.push_back((middle_us_mm - region.centre_us_mm).norm() <= region.radius_mm);
  return inside;
}

/// The sums of wider groups of clusters, all of them inside: of what those and their neighbours
/// reach together, and of the same at their neighbours.
Rows sums_of_wide_groups(Rows together, const Clusters& clusters, const std::vector<bool>& inside) {
  for (std::vector<double>& row : together) {
    for (std::size_t c = 0; c < row.size(); ++c)
      if (!inside[c]) row[c] = 0.0;
    const std::vector<double> of_neighbours = clusters.sums_of_neighbours(row);
    for (std::size_t c = 0; c < row.size(); ++c) row[c] += of_neighbours[c];
  }
  return together;
}

/// Root mean square length of the translations that groups like best whose middle clusters are
/// inside. A group's sums are those at its middle cluster.
double motion_mm(const Rows& of_groups, const std::vector<Vector3d>& moves_mm,
                 const std::vector<bool>& inside) {
  double squares = 0.0;
  double weights = 0.0;
  for (std::size_t c = 0; c < inside.size(); ++c) {
    if (!inside[c]) continue;
    const Best best = best_of(of_groups, c);
    squares += best.rise * moves_mm[best.translation].squaredNorm();
    weights += best.rise;
  }
  return weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
}

/// The translations that clusters and their neighbours together like best, between those offered.
std::vector<Wish> wishes_of(const Rows& together, const Clusters& clusters,
                            const std::vector<Vector3d>& moves_mm) {
  const PeakFinder finder(moves_mm);
  std::vector<Wish> wishes;
  std::vector<double> values(moves_mm.size());
  for (std::size_t c = 0; c < clusters.count(); ++c) {
    for (std::size_t t = 0; t < together.size(); ++t) values[t] = together[t][c];
    wishes.push_back(
        {clusters.middles_us_mm()[c], finder.peak_mm(values), best_of(together, c).rise});
  }
  return wishes;
}

}  // namespace

std::optional<LocalAgreement> local_agreement(const Similarity& similarity, const Candidate& pose,
                                              const LocalAgreementOptions& options, Run& run) {
  const Clusters clusters(similarity.part_centres_us_mm(), options.cluster_mm);
  if (clusters.count() == 0) return std::nullopt;
  const std::vector<Vector3d> moves_mm = translations(options.step_mm);
  Rows own(moves_mm.size());
  Rows of_neighbours(moves_mm.size());
  parallel_for(static_cast<int>(moves_mm.size()), [&](int i) {
    run.check_cancelled();
    const auto at = static_cast<std::size_t>(i);
    const Candidate moved{Eigen::Translation3d(moves_mm[at]) * pose.T_us_ct, pose.errors};
    own[at] = clusters.sums(similarity.parts(moved.pose()));
    of_neighbours[at] = clusters.sums_of_neighbours(own[at]);
  });
  run.count_evaluations(moves_mm.size());
  const std::optional<double> share = share_of_rise(own, of_neighbours);
  if (!share) return std::nullopt;
  const double advantage = advantage_of_shared(own);
  const Rows together = sums_of(std::move(own), of_neighbours);
  const std::vector<bool> inside = are_in(options.tissue, clusters);
  const Rows wide = sums_of_wide_groups(together, clusters, inside);
  const std::vector<Wish> wishes = wishes_of(together, clusters, moves_mm);
  return LocalAgreement{*share,
                        advantage,
                        motion_mm(together, moves_mm, inside),
                        motion_mm(wide, moves_mm, inside),
                        deformation_mm(wishes, options.tissue),
                        rigid_motion(wishes)};
}

}  // namespace usct::registration
