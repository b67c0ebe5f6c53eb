#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkPLYWriter.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>

#include <cmath>
#include <stdexcept>
#include <string_view>

#include "io/bytes.h"
#include "rendering/ply_files.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct {
namespace {

using Colour = std::array<float, 3>;

vtkNew<vtkPolyData> mesh_of(const Surface& surface) {
  const vtkNew<vtkPoints> points;
  for (const Eigen::Vector3d& p_mm : surface.points_mm) points->InsertNextPoint(p_mm.data());
  const vtkNew<vtkCellArray> triangles;
  for (const auto& [a, b, c] : surface.triangles) triangles->InsertNextCell({a, b, c});
  vtkNew<vtkPolyData> mesh;
  mesh->SetPoints(points);
  mesh->SetPolys(triangles);
  return mesh;
}

/// VTK does not notice a full disk while it writes a PLY file: the length of the file tells.
bool is_whole_ply(const std::filesystem::path& path, vtkPolyData& mesh, std::size_t point_bytes) {
  // A name may hold the word, but not on a line of its own.
  constexpr std::string_view kEnd = "\nend_header\n";
  constexpr std::size_t kTriangleBytes = 1 + 3 * 4;
  const io::Bytes bytes = io::read_bytes(path);
  const std::string_view text = io::text_view(bytes);
  const std::size_t header = text.find(kEnd);
  return header != std::string_view::npos &&
         text.size() == header + kEnd.size() +
                            point_bytes * static_cast<std::size_t>(mesh.GetNumberOfPoints()) +
                            kTriangleBytes * static_cast<std::size_t>(mesh.GetNumberOfPolys());
}

void write_ply(const Surface& surface, const std::string& name, const std::optional<Colour>& colour,
               const std::filesystem::path& path) {
  const vtkNew<vtkPolyData> mesh = mesh_of(surface);
  const vtkNew<vtkPLYWriter> writer;
  writer->SetInputData(mesh);
  writer->AddComment("SPACE=LPS");
  writer->AddComment("unit mm");
  writer->AddComment("name " + name);
  std::size_t point_bytes = 3 * 4;
  if (colour) {
    const auto byte = [&](std::size_t channel) {
      return static_cast<unsigned char>(std::lround(255.0F * (*colour)[channel]));
    };
    writer->SetColorModeToUniformPointColor();
    writer->SetColor(byte(0), byte(1), byte(2));
    point_bytes += 3;
  }
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    writer->SetFileName(temporary.c_str());
    if (writer->Write() == 0 || !is_whole_ply(temporary, *mesh, point_bytes))
      throw std::runtime_error(path.string() + ": VTK could not write the PLY file");
  });
}

}  // namespace
}  // namespace usct

extern "C" const void* usct_module() {
  static const usct::PlyFiles functions{usct::write_ply};
  return &functions;
}
