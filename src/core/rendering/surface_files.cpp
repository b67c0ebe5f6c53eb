#include "us_ct_registration/rendering/surface_files.h"

#include <algorithm>
#include <cstring>

#include "io/bytes.h"
#include "module.h"
#include "rendering/ply_files.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

/// The text without line breaks, which would end its line of a header.
std::string in_one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char letter) { return letter < ' '; }, ' ');
  return text;
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
                   const std::optional<std::array<float, 3>>& colour,
                   const std::filesystem::path& path) {
  require_surface_extension(path);
  if (surface.triangles.empty()) throw InputError(path.string(), "no triangles to write");
  if (path.extension() == ".ply")
    module<PlyFiles>().write(surface, in_one_line(name), colour, path);
  else
    write_stl(surface, name, path);
}

}  // namespace usct
