#include "us_ct_registration/rendering/surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "module.h"
#include "parallel.h"
#include "rendering/iso_mesh.h"
#include "us_ct_registration/error.h"
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

/// Area of the faces between inside and outside, along each axis.
template <typename T>
double area_of_faces_mm2(const Field<T>& field) {
  const Eigen::Vector3i begin = field.region.begin;
  const Eigen::Vector3i end = begin + field.region.size;
  // Counts of each slice, so that threads share nothing.
  std::vector<Eigen::Array3d> across(static_cast<std::size_t>(field.region.size.z()));
  parallel_for(field.region.size.z(), [&](int slice) {
    const int k = begin.z() + slice;
    Eigen::Array<std::size_t, 3, 1> faces(0, 0, 0);
    for (int j = begin.y(); j < end.y(); ++j)
      for (int i = begin.x(); i < end.x(); ++i) {
        const bool inside = field.is_inside(i, j, k);
        faces[0] += i + 1 < end.x() && inside != field.is_inside(i + 1, j, k);
        faces[1] += j + 1 < end.y() && inside != field.is_inside(i, j + 1, k);
        faces[2] += k + 1 < end.z() && inside != field.is_inside(i, j, k + 1);
      }
    across[static_cast<std::size_t>(slice)] = faces.cast<double>();
  });
  const Eigen::Array3d faces =
      std::accumulate(across.begin(), across.end(), Eigen::Array3d(Eigen::Array3d::Zero()));
  const Eigen::Vector3d& spacing = field.volume.grid.spacing_mm;
  return faces[0] * spacing.y() * spacing.z() + faces[1] * spacing.x() * spacing.z() +
         faces[2] * spacing.x() * spacing.y();
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
  double step_mm = std::sqrt(kTrianglesPerVoxelFace * area_of_faces_mm2(field) /
                             (kMeshedPerKept * static_cast<double>(most_triangles)));
  // A grid that is too coarse for a thin object shows nothing of it.
  double lost_mm = std::numeric_limits<double>::infinity();
  for (;;) {
    const Eigen::Vector3i factors = factors_for(field.volume.grid, step_mm);
    const auto is_same = [&] { return factors_for(field.volume.grid, step_mm) == factors; };
    Surface surface =
        module<IsoMesh>().mesh(sampled(field, factors), field.iso, field.smoothing, most_triangles);
    const bool is_lost = surface.triangles.empty() && factors != Eigen::Vector3i::Ones();
    if (is_lost) {
      lost_mm = step_mm;
      while (is_same()) step_mm /= 1.2;
      continue;
    }
    if (surface.triangles.size() <= most_triangles) return surface;
    // The estimate above was wrong, or the decimation found no more edges to remove.
    step_mm = std::max(step_mm, field.volume.grid.spacing_mm.minCoeff());
    while (is_same()) step_mm *= 1.2;
    if (step_mm >= lost_mm) return {};
  }
}

float is_label(std::uint16_t voxel, int label) { return voxel == label ? 1.0F : 0.0F; }
float as_it_is(std::int16_t voxel, int) { return voxel; }

/// The region of each label, found in one pass.
std::map<int, Region> regions_of(const LabelVolume& labels) {
  std::map<int, std::pair<Eigen::Vector3i, Eigen::Vector3i>> corners;
  const Grid& grid = labels.grid;
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const int label = labels.at(i, j, k);
        if (label == 0) continue;
        const Eigen::Vector3i index(i, j, k);
        const auto [entry, is_new] = corners.try_emplace(label, index, index);
        if (is_new) continue;
        entry->second.first = entry->second.first.cwiseMin(index);
        entry->second.second = entry->second.second.cwiseMax(index);
      }
  std::map<int, Region> regions;
  for (const auto& [label, box] : corners)
    regions[label] = {box.first, box.second - box.first + Eigen::Vector3i::Ones()};
  return regions;
}

}  // namespace

std::map<int, Surface> label_surfaces(const LabelVolume& labels, std::size_t most_triangles) {
  std::map<int, Surface> surfaces;
  for (const auto& [label, region] : regions_of(labels))
    surfaces[label] = bounded_surface(
        Field<std::uint16_t>{labels, region, is_label, label, 0.5F, 0.0F, Smoothing::kAlways},
        most_triangles);
  return surfaces;
}

std::string border_warning(const LabelVolume& labels, const LabelTable& table) {
  std::string cut;
  for (const auto& [label, region] : regions_of(labels))
    if (region.begin.minCoeff() == 0 ||
        ((region.begin + region.size).array() == labels.grid.size.array()).any())
      cut += (cut.empty() ? "'" : ", '") + label_text(label, table) + "'";
  return cut.empty() ? cut : "the label map ends inside " + cut + ": surfaces end there in planes";
}

Surface iso_surface(const CtVolume& ct, double hu, std::size_t most_triangles) {
  constexpr float kAirHu = -1024.0F;
  const auto iso = static_cast<float>(hu);
  return bounded_surface(Field<std::int16_t>{ct, whole(ct.grid), as_it_is, 0, iso, kAirHu,
                                             Smoothing::kBeforeDecimation},
                         most_triangles);
}

}  // namespace usct
