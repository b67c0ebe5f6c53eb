#include "us_ct_registration/ultrasound/compounding.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "parallel.h"
#include "require.h"
#include "ultrasound/hole_filling.h"
#include "ultrasound/lattice.h"
#include "ultrasound/planes.h"

namespace usct {
namespace {

/// Points per side of the square that a voxel averages over, at most.
constexpr int kFinestFootprint = 8;

/// A range of voxels [first, last] of a row; empty if first > last.
struct Range {
  double first;
  double last;

  /// Keeps the i with lowest <= start + i * step <= highest.
  void clip(double start, double step, double lowest, double highest) {
    if (step == 0.0) {
      if (start < lowest || start > highest) last = first - 1.0;
      return;
    }
    const double a = (lowest - start) / step;
    const double b = (highest - start) / step;
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
};

/// Compounds all planes into one slab of the grid (the voxels of one index k), plane after plane.
class SlabCompounder {
 public:
  SlabCompounder(const Planes& planes, const CompoundOptions& options, ScanConverted& result)
      : planes_(planes),
        compounding_(options.compounding),
        half_thickness_mm_(0.5 * options.slice_thickness_mm),
        bounds_(planes.bounds()),
        result_(result) {
    const Grid& grid = result.volume.grid;
    for (int plane = 0; plane < planes.count(); ++plane) {
      T_plane_index_.push_back(planes.T_plane_us(plane) * grid.T_physical_index());
      const double side_mm = options.average_in_plane ? grid.spacing_mm.minCoeff() : 0.0;
      footprints_.push_back(footprint(side_mm, planes.pitch_mm(plane), planes.unit_mm(plane)));
    }
  }

  void compound(int k) const {
    const Eigen::Vector3i& size = result_.volume.grid.size;
    const auto row = static_cast<std::size_t>(size.x());
    std::vector<Cell> cells(row * static_cast<std::size_t>(size.y()));
    for (int plane = 0; plane < planes_.count(); ++plane)
      if (may_meet_slab(plane, k))
        for (int j = 0; j < size.y(); ++j)
          add_to_row(plane, j, k, cells.data() + static_cast<std::size_t>(j) * row);
    const std::size_t offset = result_.volume.grid.offset(0, 0, k);
    for (std::size_t n = 0; n < cells.size(); ++n) {
      if (!(cells[n].weight > 0.0F)) continue;
      result_.volume.voxels[offset + n] = grey(cells[n].sum / cells[n].weight);
      result_.mask.voxels[offset + n] = 255;
    }
  }

 private:
  struct Cell {
    float sum = 0.0F;
    float weight = 0.0F;
  };

  bool may_meet_slab(int plane, int k) const {
    const Eigen::Vector3i& size = result_.volume.grid.size;
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -lowest;
    for (const int i : {0, size.x() - 1})
      for (const int j : {0, size.y() - 1}) {
        const double distance =
            (T_plane_index_[static_cast<std::size_t>(plane)] * Eigen::Vector3d(i, j, k)).z();
        lowest = std::min(lowest, distance);
        highest = std::max(highest, distance);
      }
    return lowest < half_thickness_mm_ && highest > -half_thickness_mm_;
  }

  void add_to_row(int plane, int j, int k, Cell* row) const {
    const Eigen::Affine3d& T = T_plane_index_[static_cast<std::size_t>(plane)];
    const Eigen::Vector3d start = T * Eigen::Vector3d(0, j, k);
    const Eigen::Vector3d step = T.linear().col(0);
    Range range{0.0, result_.volume.grid.size.x() - 1.0};
    range.clip(start.z(), step.z(), -half_thickness_mm_, half_thickness_mm_);
    range.clip(start.x(), step.x(), bounds_.min().x(), bounds_.max().x());
    range.clip(start.y(), step.y(), bounds_.min().y(), bounds_.max().y());
    if (!(range.first <= range.last)) return;
    const int last = static_cast<int>(std::floor(range.last));
    for (int i = static_cast<int>(std::ceil(range.first)); i <= last; ++i) {
      const Eigen::Vector3d q = start + i * step;
      const auto weight = static_cast<float>(1.0 - std::abs(q.z()) / half_thickness_mm_);
      if (!(weight > 0.0F)) continue;
      if (const std::optional<float> value = average_around(plane, q.head<2>()))
        add(*value, weight, row[static_cast<std::size_t>(i)]);
    }
  }

  /// Offsets, in coordinates of the plane, of points that fill a square around a voxel's centre.
  static std::vector<Eigen::Vector2d> footprint(double side_mm, double pitch_mm,
                                                const Eigen::Vector2d& unit_mm) {
    const int n = static_cast<int>(
        std::clamp(std::ceil(side_mm / pitch_mm), 1.0, static_cast<double>(kFinestFootprint)));
    std::vector<Eigen::Vector2d> points;
    for (int b = 0; b < n; ++b)
      for (int a = 0; a < n; ++a)
        points.push_back(side_mm *
                         (Eigen::Vector2d(a + 0.5, b + 0.5) / n - Eigen::Vector2d::Constant(0.5))
                             .cwiseQuotient(unit_mm));
    return points;
  }

  /// The mean over the known points of the footprint; empty if the middle itself is unknown.
  std::optional<float> average_around(int plane, const Eigen::Vector2d& at) const {
    const std::vector<Eigen::Vector2d>& points = footprints_[static_cast<std::size_t>(plane)];
    const std::optional<float> middle = planes_.at(plane, at.x(), at.y());
    if (!middle || points.size() == 1) return middle;
    float sum = 0.0F;
    float count = 0.0F;
    for (const Eigen::Vector2d& point : points)
      if (const auto value = planes_.at(plane, at.x() + point.x(), at.y() + point.y())) {
        sum += *value;
        count += 1.0F;
      }
    return count > 0.0F ? sum / count : *middle;
  }

  void add(float value, float weight, Cell& cell) const {
    switch (compounding_) {
      case Compounding::kMean:
        cell.sum += weight * value;
        cell.weight += weight;
        return;
      case Compounding::kMaximum:
        cell.sum = std::max(cell.sum, value);
        cell.weight = 1.0F;
        return;
      case Compounding::kLatest:
        cell = {value, 1.0F};
        return;
    }
  }

  const Planes& planes_;
  Compounding compounding_;
  double half_thickness_mm_;
  Eigen::AlignedBox2d bounds_;
  std::vector<Eigen::Affine3d> T_plane_index_;
  std::vector<std::vector<Eigen::Vector2d>> footprints_;
  ScanConverted& result_;
};

ScanConverted compound_planes(const Planes& planes, const Grid& grid,
                              const CompoundOptions& options, const Progress& progress) {
  grid.validate("grid");
  options.validate("compounding");
  ScanConverted result{UsVolume(grid), MaskVolume(grid)};
  const SlabCompounder compounder(planes, options, result);
  parallel_for(
      grid.size.z(), [&](int k) { compounder.compound(k); }, progress);
  if (options.hole_fill_radius_mm > 0.0)
    result = with_holes_filled(result, options.hole_fill_radius_mm);
  return result;
}

}  // namespace

void CompoundOptions::validate(const std::string& source) const {
  require_positive(source, "slice_thickness_mm", slice_thickness_mm);
  require_not_negative(source, "hole_fill_radius_mm", hole_fill_radius_mm);
}

ScanConverted compound(const PreScanVolume& prescan, const Grid& grid,
                       const CompoundOptions& options, const Progress& progress) {
  prescan.validate("pre-scan volume");
  if (prescan.geometry.is_motorised())
    throw InputError("pre-scan volume", "is motorised, must be tracked (scan-convert it)");
  return compound_planes(PreScanPlanes(prescan), grid, options, progress);
}

ScanConverted compound(const TrackedImages& images, const Grid& grid,
                       const CompoundOptions& options, const Progress& progress) {
  images.validate("tracked images");
  return compound_planes(ImagePlanes(images), grid, options, progress);
}

}  // namespace usct
