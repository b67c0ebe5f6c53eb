#include "us_ct_registration/rendering/surface_files.h"

#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkPLYWriter.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "io/bytes.h"
#include "us_ct_registration/error.h"
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

/// The text without line breaks, which would end its line of a header.
std::string in_one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char letter) { return letter < ' '; }, ' ');
  return text;
}

/// VTK does not notice a full disk while it writes a PLY file: the length of the file tells.
bool is_whole_ply(const std::filesystem::path& path, vtkPolyData& mesh, std::size_t point_bytes) {
  // A name may hold the word, but not on a line of its own.
  constexpr std::string_view kEnd = "\nend_header\n";
  constexpr std::size_t kTriangleBytes = 1 + 3 * 4;
  const io::Bytes bytes = io::read_bytes(path);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t header = text.find(kEnd);
  return header != std::string_view::npos &&
         text.size() == header + kEnd.size() +
                            point_bytes * static_cast<std::size_t>(mesh.GetNumberOfPoints()) +
                            kTriangleBytes * static_cast<std::size_t>(mesh.GetNumberOfPolys());
}

void write_ply(vtkPolyData& mesh, const std::string& name, const std::optional<Colour>& colour,
               const std::filesystem::path& path) {
  const vtkNew<vtkPLYWriter> writer;
  writer->SetInputData(&mesh);
  writer->AddComment("SPACE=LPS");
  writer->AddComment("unit mm");
  writer->AddComment("name " + in_one_line(name));
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
    if (writer->Write() == 0 || !is_whole_ply(temporary, mesh, point_bytes))
      throw std::runtime_error(path.string() + ": VTK could not write the PLY file");
  });
}

void append(const Eigen::Vector3d& vector, io::Bytes& bytes) {
  for (const double value : vector) {
    const auto number = static_cast<float>(value);
    std::int32_t bits = 0;
    std::memcpy(&bits, &number, sizeof(bits));
    io::append_int32_le(bytes, bits);
  }
}

/// Binary STL: 80 bytes of header, the number of triangles, and 50 bytes for each. vtkSTLWriter
/// would load VTK's rendering and codecs of images at every start of usct.
void write_stl(const Surface& surface, const std::string& name, const std::filesystem::path& path) {
  std::string header = "SPACE=LPS unit=mm " + in_one_line(name);
  header.resize(80, '\0');
  io::Bytes bytes(header.begin(), header.end());
  io::append_int32_le(bytes, static_cast<std::int32_t>(surface.triangles.size()));
  for (const auto& triangle : surface.triangles) {
    const Eigen::Vector3d& a = surface.points_mm[triangle[0]];
    const Eigen::Vector3d& b = surface.points_mm[triangle[1]];
    const Eigen::Vector3d& c = surface.points_mm[triangle[2]];
    for (const Eigen::Vector3d& vector :
         {Eigen::Vector3d((b - a).cross(c - a).normalized()), a, b, c})
      append(vector, bytes);
    bytes.insert(bytes.end(), 2, 0);
  }
  io::write_bytes(path, bytes);
}

}  // namespace

void require_surface_extension(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension != ".ply" && extension != ".stl")
    throw InputError(path.string(),
                     "has extension '" + extension + "', a surface's must be .ply or .stl");
}

void write_surface(const Surface& surface, const std::string& name,
                   const std::optional<Colour>& colour, const std::filesystem::path& path) {
  require_surface_extension(path);
  if (surface.triangles.empty()) throw InputError(path.string(), "no triangles to write");
  if (path.extension() == ".ply")
    write_ply(*mesh_of(surface), name, colour, path);
  else
    write_stl(surface, name, path);
}

}  // namespace usct
