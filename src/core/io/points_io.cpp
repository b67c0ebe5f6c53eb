#include "us_ct_registration/io/points_io.h"

#include <string_view>

#include "io/bytes.h"
#include "io/text.h"
#include "us_ct_registration/error.h"

namespace usct {

std::vector<Eigen::Vector3d> read_points_mm(const std::filesystem::path& path) {
  const std::string source = path.string();
  const io::Bytes bytes = io::read_bytes(path);
  const std::vector<std::string_view> lines =
      io::split({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, '\n');
  if (io::trimmed(lines[0]) != "x,y,z")
    throw InputError(source,
                     "line 1 is " + io::in_quotes(io::trimmed(lines[0])) + ", must be 'x,y,z'");
  std::vector<Eigen::Vector3d> points_mm;
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const std::string_view line = io::trimmed(lines[i]);
    if (line.empty()) continue;
    const std::string where = "line " + std::to_string(i + 1);
    const std::vector<std::string_view> fields = io::split(line, ',');
    if (fields.size() != 3)
      throw InputError(
          source, where + " has " + std::to_string(fields.size()) + " fields, must have 3 (x,y,z)");
    points_mm.emplace_back(io::parse_double(fields[0], source, where + " x"),
                           io::parse_double(fields[1], source, where + " y"),
                           io::parse_double(fields[2], source, where + " z"));
  }
  if (points_mm.empty()) throw InputError(source, "has no points");
  return points_mm;
}

void write_points_mm(const std::vector<Eigen::Vector3d>& points_mm,
                     const std::filesystem::path& path) {
  if (points_mm.empty()) throw InputError(path.string(), "no points to write");
  std::string text = "x,y,z\n";
  for (const Eigen::Vector3d& p : points_mm) {
    if (!p.allFinite()) throw InputError(path.string(), "a point to write is not finite");
    text += io::format_double(p.x()) + "," + io::format_double(p.y()) + "," +
            io::format_double(p.z()) + "\n";
  }
  io::write_text(path, text);
}

}  // namespace usct
