#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkQuadricDecimation.h>
#include <vtkSmartPointer.h>
#include <vtkWindowedSincPolyDataFilter.h>

#include <utility>

#include "rendering/iso_mesh.h"

namespace usct {
namespace {

using Mesh = vtkSmartPointer<vtkPolyData>;

/// Chosen in docs/experiments/2026-11-23-surfaces.md. A narrower band shrinks thin structures, and
/// most other pairs scale large surfaces by up to 0.2 %, the filter's gain at frequency 0.
constexpr double kPassBand = 0.04;
constexpr int kIterations = 15;

/// Flying edges on the axes of the grid, in mm from its first voxel. VTK knows no mirrored grids.
Mesh flying_edges(const Volume<float>& field, float iso) {
  const vtkNew<vtkFloatArray> values;
  // VTK takes no pointer to const, and does not write; 1: the volume keeps the memory.
  values->SetArray(const_cast<float*>(field.voxels.data()),
                   static_cast<vtkIdType>(field.voxels.size()), 1);
  const vtkNew<vtkImageData> image;
  const Eigen::Vector3i& size = field.grid.size;
  image->SetDimensions(size.x(), size.y(), size.z());
  image->SetSpacing(field.grid.spacing_mm.data());
  image->GetPointData()->SetScalars(values);
  const vtkNew<vtkFlyingEdges3D> edges;
  edges->SetInputData(image);
  edges->SetValue(0, iso);
  edges->ComputeNormalsOff();
  edges->ComputeGradientsOff();
  edges->ComputeScalarsOff();
  edges->Update();
  return edges->GetOutput();
}

/// A low-pass filter keeps the volume, where averaging over neighbours would shrink it.
Mesh smoothed(const Mesh& mesh) {
  const vtkNew<vtkWindowedSincPolyDataFilter> filter;
  filter->SetInputData(mesh);
  filter->SetPassBand(kPassBand);
  filter->SetNumberOfIterations(kIterations);
  filter->NormalizeCoordinatesOn();
  filter->NonManifoldSmoothingOn();
  filter->BoundarySmoothingOff();
  filter->FeatureEdgeSmoothingOff();
  filter->Update();
  return filter->GetOutput();
}

Mesh decimated(const Mesh& mesh, std::size_t most_triangles) {
  const vtkNew<vtkQuadricDecimation> filter;
  filter->SetInputData(mesh);
  filter->SetTargetReduction(1.0 - static_cast<double>(most_triangles) /
                                       static_cast<double>(mesh->GetNumberOfPolys()));
  filter->Update();
  return filter->GetOutput();
}

Surface in_frame_of(const Grid& grid, const Mesh& mesh) {
  Surface surface;
  surface.points_mm.reserve(static_cast<std::size_t>(mesh->GetNumberOfPoints()));
  for (vtkIdType i = 0; i < mesh->GetNumberOfPoints(); ++i) {
    Eigen::Vector3d p_mm;
    mesh->GetPoint(i, p_mm.data());
    surface.points_mm.push_back(grid.physical_from_index(p_mm.cwiseQuotient(grid.spacing_mm)));
  }
  const bool is_mirrored = grid.direction.determinant() < 0.0;
  surface.triangles.reserve(static_cast<std::size_t>(mesh->GetNumberOfPolys()));
  for (vtkIdType i = 0; i < mesh->GetNumberOfPolys(); ++i) {
    vtkIdType corners = 0;
    const vtkIdType* ids = nullptr;
    mesh->GetPolys()->GetCellAtId(i, corners, ids);
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t corner = 0; corner < 3; ++corner)
      triangle[corner] = static_cast<std::uint32_t>(ids[corner]);
    if (is_mirrored) std::swap(triangle[1], triangle[2]);
    surface.triangles.push_back(triangle);
  }
  return surface;
}

Surface iso_mesh(const Volume<float>& field, float iso, Smoothing smoothing,
                 std::size_t most_triangles) {
  Mesh mesh = flying_edges(field, iso);
  if (mesh->GetNumberOfPolys() == 0) return {};
  const bool is_large = static_cast<std::size_t>(mesh->GetNumberOfPolys()) > most_triangles;
  if (is_large || smoothing == Smoothing::kAlways) mesh = smoothed(mesh);
  if (is_large) mesh = decimated(mesh, most_triangles);
  return in_frame_of(field.grid, mesh);
}

}  // namespace
}  // namespace usct

extern "C" const void* usct_module() {
  static const usct::IsoMesh functions{usct::iso_mesh};
  return &functions;
}
