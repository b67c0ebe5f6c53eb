#include "us_ct_registration/io/results/points_io.h"

#include <string_view>

#include "io/bytes.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct {

std::vector<Eigen::Vector3d> read_points_mm(const std::filesystem::path& path) {
  const std::string source = path.string();
  const io::Bytes bytes = io::read_text_bytes(path);
  const std::vector<std::string_view> lines = split(io::text_view(bytes), '\n');
  std::string_view title = lines[0];
  // Spreadsheets write a byte order mark before UTF-8.
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (title.substr(0, kMark.size()) == kMark) title.remove_prefix(kMark.size());
  if (trimmed(title) != "x,y,z")
    throw InputError(source, "line 1 is " + in_quotes(trimmed(title)) + ", must be 'x,y,z'");
  std::vector<Eigen::Vector3d> points_mm;
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const std::string_view line = trimmed(lines[i]);
    if (line.empty()) continue;
    const std::string where = "line " + std::to_string(i + 1);
    const std::vector<std::string_view> fields = split(line, ',');
    if (fields.size() != 3)
      throw InputError(
          source, where + " has " + std::to_string(fields.size()) + " fields, must have 3 (x,y,z)");
    points_mm.emplace_back(parse_double(fields[0], source, where + " x"),
                           parse_double(fields[1], source, where + " y"),
                           parse_double(fields[2], source, where + " z"));
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
    text += format_double(p.x()) + "," + format_double(p.y()) + "," + format_double(p.z()) + "\n";
  }
  write_text(path, text);
}

}  // namespace usct
