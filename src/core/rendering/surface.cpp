#include "us_ct_registration/rendering/surface.h"

#include <itkBinaryMask3DMeshSource.h>
#include <itkImage.h>
#include <itkMesh.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "us_ct_registration/error.h"
#include "us_ct_registration/volume/operations.h"

namespace usct {
namespace {

using Mask = itk::Image<unsigned char, 3>;
using Mesh = itk::Mesh<float, 3>;

/// ITK's surface of a mask has its points half way between voxels: per area of a voxel's face it
/// has about this many triangles (measured on spheres).
constexpr double kTrianglesPerVoxelFace = 4.2;
/// Ratio of the area of a mask's faces to that of the smooth surface (of a sphere).
constexpr double kFacesPerArea = 1.5;
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

  float at(int i, int j, int k) const { return value(volume.at(i, j, k), label); }
  bool is_inside(int i, int j, int k) const { return at(i, j, k) >= iso; }
};

/// Area of the faces between inside and outside, along each axis.
template <typename T>
double area_of_faces_mm2(const Field<T>& field) {
  const Eigen::Vector3i begin = field.region.begin;
  const Eigen::Vector3i end = begin + field.region.size;
  std::size_t across_i = 0;
  std::size_t across_j = 0;
  std::size_t across_k = 0;
#pragma omp parallel for schedule(static) reduction(+ : across_i, across_j, across_k)
  for (int k = begin.z(); k < end.z(); ++k)
    for (int j = begin.y(); j < end.y(); ++j)
      for (int i = begin.x(); i < end.x(); ++i) {
        const bool inside = field.is_inside(i, j, k);
        across_i += i + 1 < end.x() && inside != field.is_inside(i + 1, j, k);
        across_j += j + 1 < end.y() && inside != field.is_inside(i, j + 1, k);
        across_k += k + 1 < end.z() && inside != field.is_inside(i, j, k + 1);
      }
  const Eigen::Vector3d& spacing = field.volume.grid.spacing_mm;
  return static_cast<double>(across_i) * spacing.y() * spacing.z() +
         static_cast<double>(across_j) * spacing.x() * spacing.z() +
         static_cast<double>(across_k) * spacing.x() * spacing.y();
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
#pragma omp parallel for schedule(static)
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        const Eigen::Vector3i from = field.region.begin + Eigen::Vector3i(i, j, k);
        const Eigen::Vector3i to = from - begin;
        fine.at(to.x(), to.y(), to.z()) = field.at(from.x(), from.y(), from.z());
      }
  if (factors == Eigen::Vector3i::Ones()) return fine;
  return shrink(fine, factors, whole(padded));
}

Mesh::Pointer surface_of_mask(const Volume<float>& field, float iso) {
  const auto mask = Mask::New();
  Mask::SizeType size;
  for (unsigned axis = 0; axis < 3; ++axis)
    size[axis] = static_cast<itk::SizeValueType>(field.grid.size[static_cast<int>(axis)]);
  mask->SetRegions(size);
  mask->Allocate();
  std::transform(field.voxels.begin(), field.voxels.end(), mask->GetBufferPointer(),
                 [iso](float value) { return value >= iso ? 1 : 0; });
  const auto filter = itk::BinaryMask3DMeshSource<Mask, Mesh>::New();
  filter->SetInput(mask);
  filter->SetObjectValue(1);
  filter->Update();
  return filter->GetOutput();
}

/// Value and gradient of the trilinear interpolation; `index` has a neighbour on each side.
struct Local {
  double value = 0.0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

Local interpolated(const Volume<float>& field, const Eigen::Vector3d& index) {
  const Eigen::Vector3i most = field.grid.size - Eigen::Vector3i::Constant(2);
  Eigen::Vector3i base;
  for (int axis = 0; axis < 3; ++axis)
    base[axis] = std::clamp(static_cast<int>(std::floor(index[axis])), 0, most[axis]);
  const Eigen::Vector3d t = index - base.cast<double>();
  Local local;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3i d(corner & 1, (corner >> 1) & 1, corner >> 2);
    Eigen::Vector3d weight;
    for (int axis = 0; axis < 3; ++axis) weight[axis] = d[axis] == 1 ? t[axis] : 1.0 - t[axis];
    const double value = field.at(base.x() + d.x(), base.y() + d.y(), base.z() + d.z());
    local.value += weight.prod() * value;
    for (int axis = 0; axis < 3; ++axis)
      local.gradient[axis] +=
          (d[axis] == 1 ? value : -value) * weight[(axis + 1) % 3] * weight[(axis + 2) % 3];
  }
  return local;
}

/// Moves a point of the mask's surface along the gradient to the iso-value, by at most half a
/// voxel, the largest possible distance.
Eigen::Vector3d on_surface(const Volume<float>& field, float iso, const Eigen::Vector3d& start) {
  constexpr int kSteps = 3;
  Eigen::Vector3d index = start;
  for (int step = 0; step < kSteps; ++step) {
    const Local local = interpolated(field, index);
    const double slope = local.gradient.squaredNorm();
    if (!(slope > 0.0)) return index;
    index += local.gradient * ((iso - local.value) / slope);
    index = index.cwiseMax(start - Eigen::Vector3d::Constant(0.5))
                .cwiseMin(start + Eigen::Vector3d::Constant(0.5));
  }
  return index;
}

Surface surface_of(const Volume<float>& field, float iso) {
  const Mesh::Pointer mesh = surface_of_mask(field, iso);
  Surface surface;
  surface.points_mm.reserve(mesh->GetNumberOfPoints());
  const auto points = mesh->GetPoints();
  for (auto it = points->Begin(); it != points->End(); ++it) {
    const auto& point = it.Value();
    surface.points_mm.push_back(field.grid.physical_from_index(
        on_surface(field, iso, Eigen::Vector3d(point[0], point[1], point[2]))));
  }
  const bool is_mirrored = field.grid.direction.determinant() < 0.0;
  surface.triangles.reserve(mesh->GetNumberOfCells());
  const auto cells = mesh->GetCells();
  if (cells == nullptr) return surface;
  for (auto it = cells->Begin(); it != cells->End(); ++it) {
    std::array<std::uint32_t, 3> triangle{};
    std::copy_n(it.Value()->PointIdsBegin(), 3, triangle.begin());
    if (is_mirrored) std::swap(triangle[1], triangle[2]);
    surface.triangles.push_back(triangle);
  }
  return surface;
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
  const double triangles_mm2 = kTrianglesPerVoxelFace * area_of_faces_mm2(field) / kFacesPerArea;
  double step_mm = std::sqrt(triangles_mm2 / static_cast<double>(most_triangles));
  for (;;) {
    Surface surface =
        surface_of(sampled(field, factors_for(field.volume.grid, step_mm)), field.iso);
    if (surface.triangles.size() <= most_triangles) return surface;
    step_mm = 1.2 * std::max(step_mm, field.volume.grid.spacing_mm.minCoeff());
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
        Field<std::uint16_t>{labels, region, is_label, label, 0.5F, 0.0F}, most_triangles);
  return surfaces;
}

Surface iso_surface(const CtVolume& ct, double hu, std::size_t most_triangles) {
  constexpr float kAirHu = -1024.0F;
  const auto iso = static_cast<float>(hu);
  return bounded_surface(Field<std::int16_t>{ct, whole(ct.grid), as_it_is, 0, iso, kAirHu},
                         most_triangles);
}

}  // namespace usct
