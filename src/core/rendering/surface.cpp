#include "us_ct_registration/rendering/surface.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "module.h"
#include "parallel.h"
#include "rendering/iso_mesh.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/volume/operations.h"

namespace usct {
namespace {

/// Triangles of flying edges per area of a voxel's face between inside and outside (measured on
/// spheres).
constexpr double kTrianglesPerVoxelFace = 2.0;
/// Decimation is slow, about 10 us per triangle that it removes, and more accurate than a coarser
/// grid. A grid whose mesh has about this many times the wanted triangles is a compromise.
constexpr double kMeshedPerKept = 2.0;
constexpr std::size_t kLeastTriangles = 1000;
/// A surface that keeps less of its object's volume does not show the object.
constexpr double kLeastShown = 0.5;
/// A warning is given below this share; smoothing takes less than that from a thin vessel.
constexpr double kLeastWithoutWarning = 0.75;
constexpr double kMostMissingAtEnd_mm = 5.0;

/// A field and its iso-value at the surface; outside the field the value is `outside`.
template <typename T>
struct Field {
  const Volume<T>& volume;
  Region region;
  float (*value)(T voxel, int label);
  int label;
  float iso;
  float outside;
  Smoothing smoothing;

  float at(int i, int j, int k) const { return value(volume.at(i, j, k), label); }
  bool is_inside(int i, int j, int k) const { return at(i, j, k) >= iso; }
};

/// The voxels that are inside.
struct Extent {
  double area_mm2;  // of the faces between inside and outside
  double volume_mm3;
};

template <typename T>
Extent extent_of(const Field<T>& field) {
  const Eigen::Vector3i begin = field.region.begin;
  const Eigen::Vector3i end = begin + field.region.size;
  // Counts of each slice, so that threads share nothing: faces along each axis, and voxels.
  std::vector<Eigen::Array4d> across(static_cast<std::size_t>(field.region.size.z()));
  parallel_for(field.region.size.z(), [&](int slice) {
    const int k = begin.z() + slice;
    Eigen::Array<std::size_t, 4, 1> counts(0, 0, 0, 0);
    for (int j = begin.y(); j < end.y(); ++j)
      for (int i = begin.x(); i < end.x(); ++i) {
        const bool inside = field.is_inside(i, j, k);
        counts[0] += i + 1 < end.x() && inside != field.is_inside(i + 1, j, k);
        counts[1] += j + 1 < end.y() && inside != field.is_inside(i, j + 1, k);
        counts[2] += k + 1 < end.z() && inside != field.is_inside(i, j, k + 1);
        counts[3] += inside;
      }
    across[static_cast<std::size_t>(slice)] = counts.cast<double>();
  });
  const Eigen::Array4d counts =
      std::accumulate(across.begin(), across.end(), Eigen::Array4d(Eigen::Array4d::Zero()));
  const Eigen::Vector3d& spacing = field.volume.grid.spacing_mm;
  return {counts[0] * spacing.y() * spacing.z() + counts[1] * spacing.x() * spacing.z() +
              counts[2] * spacing.x() * spacing.y(),
          counts[3] * spacing.prod()};
}

/// By the divergence theorem.
double enclosed_mm3(const Surface& surface) {
  double sum = 0.0;
  for (const auto& [a, b, c] : surface.triangles) {
    const Eigen::Vector3d& origin = surface.points_mm.front();
    sum += (surface.points_mm[a] - origin)
               .dot((surface.points_mm[b] - origin).cross(surface.points_mm[c] - origin));
  }
  return sum / 6.0;
}

/// The region of a field, coarser by `factors`, with a border of at least one sample `outside`.
template <typename T>
Volume<float> sampled(const Field<T>& field, const Eigen::Vector3i& factors) {
  const Grid& grid = field.volume.grid;
  const Eigen::Vector3i begin = field.region.begin - factors;
  const Eigen::Vector3i cells =
      (field.region.size + factors - Eigen::Vector3i::Ones()).cwiseQuotient(factors) +
      Eigen::Vector3i::Constant(2);
  Grid padded = grid;
  padded.size = cells.cwiseProduct(factors);
  padded.origin_mm = grid.physical_from_index(begin.cast<double>());
  Volume<float> fine(padded, field.outside);
  const Eigen::Vector3i size = field.region.size;
  parallel_for(size.z(), [&](int k) {
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        const Eigen::Vector3i from = field.region.begin + Eigen::Vector3i(i, j, k);
        const Eigen::Vector3i to = from - begin;
        fine.at(to.x(), to.y(), to.z()) = field.at(from.x(), from.y(), from.z());
      }
  });
  if (factors == Eigen::Vector3i::Ones()) return fine;
  return shrink(fine, factors, whole(padded));
}

Eigen::Vector3i factors_for(const Grid& grid, double step_mm) {
  Eigen::Vector3i factors;
  for (int axis = 0; axis < 3; ++axis)
    factors[axis] = std::max(1, static_cast<int>(std::lround(step_mm / grid.spacing_mm[axis])));
  return factors;
}

template <typename T>
Surface bounded_surface(const Field<T>& field, std::size_t most_triangles) {
  if (most_triangles < kLeastTriangles)
    throw InputError("most_triangles", "is " + std::to_string(most_triangles) +
                                           ", must be >= " + std::to_string(kLeastTriangles));
  const Extent extent = extent_of(field);
  double step_mm = std::sqrt(kTrianglesPerVoxelFace * extent.area_mm2 /
                             (kMeshedPerKept * static_cast<double>(most_triangles)));
  // A grid that is too coarse for a thin object shows little or nothing of it.
  double lost_mm = std::numeric_limits<double>::infinity();
  Surface remnant;
  for (;;) {
    const Eigen::Vector3i factors = factors_for(field.volume.grid, step_mm);
    const auto is_same = [&] { return factors_for(field.volume.grid, step_mm) == factors; };
    Surface surface =
        module<IsoMesh>().mesh(sampled(field, factors), field.iso, field.smoothing, most_triangles);
    const bool fits = surface.triangles.size() <= most_triangles;
    const double shown_mm3 = enclosed_mm3(surface);
    if (fits && factors != Eigen::Vector3i::Ones() && shown_mm3 < kLeastShown * extent.volume_mm3) {
      if (remnant.triangles.empty() || shown_mm3 > enclosed_mm3(remnant))
        remnant = std::move(surface);
      lost_mm = step_mm;
      while (is_same()) step_mm /= 1.2;
      continue;
    }
    if (fits) return surface;
    // The estimate above was wrong, or the decimation found no more edges to remove.
    step_mm = std::max(step_mm, field.volume.grid.spacing_mm.minCoeff());
    while (is_same()) step_mm *= 1.2;
    if (step_mm >= lost_mm) return remnant;
  }
}

float is_label(std::uint16_t voxel, int label) { return voxel == label ? 1.0F : 0.0F; }
float as_it_is(std::int16_t voxel, int) { return voxel; }

struct LabelExtent {
  Region region;
  std::size_t voxels;
};

/// The extent of each label, found in one pass.
std::map<int, LabelExtent> extents_of(const LabelVolume& labels) {
  struct Box {
    Eigen::Vector3i least, greatest;
    std::size_t voxels = 0;
  };
  std::map<int, Box> boxes;
  const Grid& grid = labels.grid;
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const int label = labels.at(i, j, k);
        if (label == 0) continue;
        const Eigen::Vector3i index(i, j, k);
        Box& box = boxes.try_emplace(label, Box{index, index}).first->second;
        box.least = box.least.cwiseMin(index);
        box.greatest = box.greatest.cwiseMax(index);
        ++box.voxels;
      }
  std::map<int, LabelExtent> extents;
  for (const auto& [label, box] : boxes)
    extents[label] = {{box.least, box.greatest - box.least + Eigen::Vector3i::Ones()}, box.voxels};
  return extents;
}

/// How far the surface ends before the voxels do, along an axis of the grid.
double missing_at_end_mm(const Surface& surface, const Grid& grid, const Region& region) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& p_mm : surface.points_mm) box.extend(grid.index_from_physical(p_mm));
  const Eigen::Vector3d begin = region.begin.cast<double>();
  const Eigen::Vector3d last = begin + (region.size - Eigen::Vector3i::Ones()).cast<double>();
  const Eigen::Vector3d missing = (box.min() - begin).cwiseMax(last - box.max());
  return missing.cwiseProduct(grid.spacing_mm).maxCoeff();
}

/// Describes the part of a label that its surface lacks; empty if it is too small to matter.
std::string loss_of(const Surface& surface, const Grid& grid, const LabelExtent& extent) {
  if (surface.triangles.empty()) return "has no surface";
  const double share =
      enclosed_mm3(surface) / (static_cast<double>(extent.voxels) * grid.spacing_mm.prod());
  const double missing_mm = missing_at_end_mm(surface, grid, extent.region);
  if (share < kLeastWithoutWarning)
    return formatted("keeps %.0f %% of its volume", 100.0 * std::max(0.0, share));
  if (missing_mm > kMostMissingAtEnd_mm)
    return formatted("ends %.0f mm before its voxels", missing_mm);
  return {};
}

}  // namespace

std::map<int, Surface> label_surfaces(const LabelVolume& labels, std::size_t most_triangles) {
  const std::map<int, LabelExtent> extents = extents_of(labels);
  std::vector<std::pair<int, Surface>> surfaces;
  for (const auto& [label, extent] : extents) surfaces.emplace_back(label, Surface());
  parallel_for(static_cast<int>(surfaces.size()), [&](int i) {
    auto& [label, surface] = surfaces[static_cast<std::size_t>(i)];
    surface = bounded_surface(Field<std::uint16_t>{labels, extents.at(label).region, is_label,
                                                   label, 0.5F, 0.0F, Smoothing::kAlways},
                              most_triangles);
  });
  return {std::make_move_iterator(surfaces.begin()), std::make_move_iterator(surfaces.end())};
}

std::string loss_warning(const LabelVolume& labels, const std::map<int, Surface>& surfaces,
                         std::size_t most_triangles, const LabelTable& table) {
  std::string lost;
  for (const auto& [label, extent] : extents_of(labels))
    if (const std::string loss = loss_of(surfaces.at(label), labels.grid, extent); !loss.empty())
      lost += (lost.empty() ? "'" : ", '") + label_text(label, table) + "' " + loss;
  return lost.empty() ? lost
                      : "surfaces of at most " + std::to_string(most_triangles) +
                            " triangles lose what is thin, more would keep it: " + lost;
}

std::string border_warning(const LabelVolume& labels, const LabelTable& table) {
  std::string cut;
  for (const auto& [label, extent] : extents_of(labels))
    if (const Region& region = extent.region;
        region.begin.minCoeff() == 0 ||
        ((region.begin + region.size).array() == labels.grid.size.array()).any())
      cut += (cut.empty() ? "'" : ", '") + label_text(label, table) + "'";
  return cut.empty() ? cut : "the label map ends inside " + cut + ": surfaces end there in planes";
}

std::vector<std::string> surface_warnings(const LabelVolume& labels,
                                          const std::map<int, Surface>& surfaces,
                                          std::size_t most_triangles, const LabelTable& table) {
  std::vector<std::string> warnings;
  for (const std::string& warning :
       {border_warning(labels, table), loss_warning(labels, surfaces, most_triangles, table)})
    if (!warning.empty()) warnings.push_back(warning);
  return warnings;
}

Surface iso_surface(const CtVolume& ct, double hu, std::size_t most_triangles) {
  constexpr float kAirHu = -1024.0F;
  const auto iso = static_cast<float>(hu);
  return bounded_surface(Field<std::int16_t>{ct, whole(ct.grid), as_it_is, 0, iso, kAirHu,
                                             Smoothing::kBeforeDecimation},
                         most_triangles);
}

}  // namespace usct
