#include "phantom/tube_tree.h"

#include <algorithm>
#include <cmath>

namespace usct::phantom {
namespace {

constexpr double kCellMm = 4.0;

Eigen::Vector3d catmull_rom(const std::vector<Eigen::Vector3d>& points, int piece, double t) {
  const int last = static_cast<int>(points.size()) - 1;
  const auto at = [&](int i) { return points[static_cast<std::size_t>(std::clamp(i, 0, last))]; };
  const Eigen::Vector3d a = at(piece - 1);
  const Eigen::Vector3d b = at(piece);
  const Eigen::Vector3d c = at(piece + 1);
  const Eigen::Vector3d d = at(piece + 2);
  return 0.5 * ((2.0 * b) + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t +
                (3.0 * b - a - 3.0 * c + d) * t * t * t);
}

}  // namespace

void TubeTree::add(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& to_mm,
                   double radius_from_mm, double radius_to_mm, Tissue tissue) {
  const Eigen::Vector3d axis = to_mm - from_mm;
  segments_.push_back(
      {from_mm, axis, std::max(1e-9, axis.squaredNorm()), radius_from_mm, radius_to_mm, tissue});
}

void TubeTree::add_curve(const std::vector<Eigen::Vector3d>& points_mm, double radius_from_mm,
                         double radius_to_mm, Tissue tissue) {
  constexpr int kSteps = 5;
  const int count = (static_cast<int>(points_mm.size()) - 1) * kSteps;
  Eigen::Vector3d previous = points_mm.front();
  for (int i = 1; i <= count; ++i) {
    const int piece = (i - 1) / kSteps;
    const double t = static_cast<double>(i - piece * kSteps) / kSteps;
    const Eigen::Vector3d next = catmull_rom(points_mm, piece, t);
    const auto radius = [&](int step) {
      return radius_from_mm + (radius_to_mm - radius_from_mm) * step / count;
    };
    add(previous, next, radius(i - 1), radius(i), tissue);
    previous = next;
  }
}

void TubeTree::build_raster() {
  const auto box_of = [](const Segment& s) {
    Eigen::AlignedBox3d box(s.from_mm);
    box.extend(Eigen::Vector3d(s.from_mm + s.axis));
    const Eigen::Vector3d margin =
        Eigen::Vector3d::Constant(std::max(s.radius_from_mm, s.radius_to_mm));
    return Eigen::AlignedBox3d(box.min() - margin, box.max() + margin);
  };
  box_.setEmpty();
  for (const Segment& s : segments_) box_.extend(box_of(s));
  if (segments_.empty()) return;
  cells_ = (box_.sizes() / kCellMm).array().floor().cast<int>() + 1;
  segments_of_cell_.assign(static_cast<std::size_t>(cells_.prod()), {});
  const auto cell = [&](const Eigen::Vector3d& p) -> Eigen::Vector3i {
    return ((p - box_.min()) / kCellMm).array().floor().cast<int>();
  };
  for (std::size_t n = 0; n < segments_.size(); ++n) {
    const Eigen::AlignedBox3d box = box_of(segments_[n]);
    const Eigen::Vector3i first = cell(box.min());
    const Eigen::Vector3i last = cell(box.max());
    for (int k = first.z(); k <= last.z(); ++k)
      for (int j = first.y(); j <= last.y(); ++j)
        for (int i = first.x(); i <= last.x(); ++i)
          segments_of_cell_[offset({i, j, k})].push_back(static_cast<int>(n));
  }
}

std::optional<TubeTree::Hit> TubeTree::find(const Eigen::Vector3d& p_mm) const {
  if (!box_.contains(p_mm)) return std::nullopt;
  const Eigen::Vector3i c = ((p_mm - box_.min()) / kCellMm).array().floor().cast<int>();
  const auto& candidates = segments_of_cell_[offset(c)];
  std::optional<Hit> hit;
  for (const int n : candidates) {
    const Segment& s = segments_[static_cast<std::size_t>(n)];
    const Eigen::Vector3d offset = p_mm - s.from_mm;
    const double t = std::clamp(offset.dot(s.axis) / s.axis_squared, 0.0, 1.0);
    const double radius = s.radius_from_mm + t * (s.radius_to_mm - s.radius_from_mm);
    const double distance_squared = (offset - t * s.axis).squaredNorm();
    if (distance_squared >= radius * radius) continue;
    const double depth = radius - std::sqrt(distance_squared);
    if (!hit) {
      hit = Hit{s.tissue, depth};
    } else if (hit->tissue == s.tissue) {
      hit->depth_mm = std::max(hit->depth_mm, depth);
    }
  }
  return hit;
}

}  // namespace usct::phantom
