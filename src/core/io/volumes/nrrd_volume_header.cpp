// The header of NRRD volumes: the part of http://teem.sourceforge.net/nrrd/format.html that scalar
// volumes with an orientation need.
#include <algorithm>
#include <map>

#include "io/bytes.h"
#include "io/format.h"
#include "io/header_fields.h"
#include "io/sibling_file.h"
#include "io/volumes/nrrd_header.h"
#include "io/volumes/volume_header.h"
#include "text.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, Component>& nrrd_types() {
  static const std::map<std::string, Component> names = {
      {"signed char", Component::kInt8},
      {"int8", Component::kInt8},
      {"int8_t", Component::kInt8},
      {"uchar", Component::kUint8},
      {"unsigned char", Component::kUint8},
      {"uint8", Component::kUint8},
      {"uint8_t", Component::kUint8},
      {"short", Component::kInt16},
      {"short int", Component::kInt16},
      {"signed short", Component::kInt16},
      {"signed short int", Component::kInt16},
      {"int16", Component::kInt16},
      {"int16_t", Component::kInt16},
      {"ushort", Component::kUint16},
      {"unsigned short", Component::kUint16},
      {"unsigned short int", Component::kUint16},
      {"uint16", Component::kUint16},
      {"uint16_t", Component::kUint16},
      {"int", Component::kInt32},
      {"signed int", Component::kInt32},
      {"int32", Component::kInt32},
      {"int32_t", Component::kInt32},
      {"uint", Component::kUint32},
      {"unsigned int", Component::kUint32},
      {"uint32", Component::kUint32},
      {"uint32_t", Component::kUint32},
      {"longlong", Component::kInt64},
      {"long long", Component::kInt64},
      {"long long int", Component::kInt64},
      {"signed long long", Component::kInt64},
      {"signed long long int", Component::kInt64},
      {"int64", Component::kInt64},
      {"int64_t", Component::kInt64},
      {"ulonglong", Component::kUint64},
      {"unsigned long long", Component::kUint64},
      {"unsigned long long int", Component::kUint64},
      {"uint64", Component::kUint64},
      {"uint64_t", Component::kUint64},
      {"float", Component::kFloat32},
      {"double", Component::kFloat64}};
  return names;
}

/// The name of a type in the spelling that every reader knows.
const char* nrrd_name(Component component) {
  switch (component) {
    case Component::kFloat32:
      return "float";
    case Component::kFloat64:
      return "double";
    default:
      return name_of(component);
  }
}

/// `count` vectors of three numbers, "(x,y,z) (x,y,z)", as columns.
Eigen::Matrix3Xd vectors(const HeaderFields& fields, const std::string& field, int count) {
  std::string numbers = fields.require(field);
  const auto brackets = std::count(numbers.begin(), numbers.end(), '(');
  std::replace_if(
      numbers.begin(), numbers.end(), [](char c) { return c == '(' || c == ')' || c == ','; }, ' ');
  const std::vector<double> values = parse_doubles(numbers, fields.source(), field);
  if (brackets != count || values.size() != 3 * static_cast<std::size_t>(count))
    fields.refuse(field, std::to_string(count) + " vector(s) of 3 numbers, as '(x,y,z)'");
  return Eigen::Map<const Eigen::Matrix3Xd>(values.data(), 3, count);
}

/// The signs that turn coordinates of the file's space into LPS.
Eigen::Vector3d signs_to_lps(const HeaderFields& fields) {
  const std::string space = lower_case(fields.require("space"));
  if (space == "left-posterior-superior" || space == "lps") return {1, 1, 1};
  if (space == "right-anterior-superior" || space == "ras") return {-1, -1, 1};
  if (space == "left-anterior-superior" || space == "las") return {1, -1, 1};
  fields.refuse("space",
                "left-posterior-superior, right-anterior-superior or left-anterior-superior");
}

void check_kinds_and_units(const HeaderFields& fields) {
  if (const auto kinds = fields.find("kinds"))
    for (const std::string_view kind : words(*kinds))
      if (kind != "domain" && kind != "space" && kind != "???" && kind != "none")
        fields.refuse("kinds", "'domain' or 'space' for each axis (one value per voxel)");
  if (const auto units = fields.find("space units"))
    for (const std::string_view unit : words(*units))
      if (unit != "\"mm\"") fields.refuse("space units", "\"mm\" for each axis");
}

Grid nrrd_grid(const HeaderFields& fields) {
  if (fields.require_ints("dimension", 1)[0] != 3) fields.refuse("dimension", "3");
  check_kinds_and_units(fields);
  const std::vector<int> sizes = fields.require_ints("sizes", 3);
  const Eigen::Vector3d to_lps = signs_to_lps(fields);
  const Eigen::Matrix3d axes_mm = vectors(fields, "space directions", 3);
  const Eigen::Vector3d origin_mm = vectors(fields, "space origin", 1);
  return grid_from_axes(fields.source(), "space directions", {sizes[0], sizes[1], sizes[2]},
                        to_lps.asDiagonal() * axes_mm, to_lps.cwiseProduct(origin_mm));
}

Component nrrd_component(const HeaderFields& fields) {
  const auto found = nrrd_types().find(lower_case(fields.require("type")));
  if (found == nrrd_types().end())
    fields.refuse("type", "an integer type of 8 to 64 bits, float or double");
  return found->second;
}

Encoding read_encoding(const HeaderFields& fields) {
  const std::string encoding = lower_case(fields.require("encoding"));
  if (encoding == "raw") return Encoding::kRaw;
  if (encoding == "gzip" || encoding == "gz") return Encoding::kGzip;
  fields.refuse("encoding", "raw or gzip");
}

bool read_big_endian(const HeaderFields& fields, Component component) {
  if (bytes_of(component) == 1) return false;
  const std::string endian = lower_case(fields.require("endian"));
  if (endian != "little" && endian != "big") fields.refuse("endian", "little or big");
  return endian == "big";
}

/// The spelling that the header uses of a field with two spellings.
std::string spelling(const HeaderFields& fields, const std::string& one, const std::string& other) {
  return fields.find(other) ? other : one;
}

/// Integers that stand for other values. Programs do not agree for which: the greatest integer
/// stands for `old max` where dcm2niix wrote the file, and for half a step less where teem did.
void refuse_quantized(const HeaderFields& fields, Component component) {
  if (component == Component::kFloat32 || component == Component::kFloat64) return;
  for (const char* field : {"old min", "oldmin", "old max", "oldmax"})
    if (fields.find(field))
      fields.refuse(field,
                    "absent: the integers stand for other values, and programs do not agree for "
                    "which; write the values themselves, or NIfTI");
}

void locate_data(const fs::path& path, const HeaderFields& fields, std::size_t header_bytes,
                 VolumeHeader& header) {
  const std::string data_field = spelling(fields, "data file", "datafile");
  const auto data_file = fields.find(data_field);
  if (data_file && (data_file->substr(0, 4) == "LIST" || data_file->find('%') != std::string::npos))
    fields.refuse(data_field, "the name of one file");
  header.data_file = data_file ? sibling_file(path, *data_file, data_field) : path;
  header.begin = data_file ? 0 : header_bytes;

  const std::string line_skip = spelling(fields, "line skip", "lineskip");
  if (fields.find(line_skip) && fields.require_ints(line_skip, 1)[0] != 0)
    fields.refuse(line_skip, "0");
  const std::string byte_skip = spelling(fields, "byte skip", "byteskip");
  if (!fields.find(byte_skip)) return;
  const int skip = fields.require_ints(byte_skip, 1)[0];
  if (skip < -1 || (skip != 0 && header.encoding != Encoding::kRaw))
    fields.refuse(byte_skip, ">= -1, and 0 where the voxels are compressed");
  if (skip >= 0) {
    header.begin += static_cast<std::uintmax_t>(skip);
  } else {  // the voxels are the end of the file
    const std::uintmax_t bytes = fs::file_size(header.data_file);
    if (bytes >= header.voxel_bytes()) header.begin = bytes - header.voxel_bytes();
  }
}

}  // namespace

VolumeHeader read_nrrd_header(const fs::path& path) {
  const NrrdHeader text = parse_nrrd_header(read_prefix(path, kLongestHeader), path.string());
  const HeaderFields fields(path.string(), text.fields);
  VolumeHeader header;
  header.format = "NRRD";
  header.grid = nrrd_grid(fields);
  header.component = nrrd_component(fields);
  refuse_quantized(fields, header.component);
  header.encoding = read_encoding(fields);
  header.big_endian = read_big_endian(fields, header.component);
  locate_data(path, fields, text.data_offset, header);
  check_data_size(path.string(), "sizes", header);
  return header;
}

Bytes nrrd_header(const Grid& grid, Component component) {
  const auto vector = [](const Eigen::Vector3d& v) {
    return "(" + format_double(v.x()) + "," + format_double(v.y()) + "," + format_double(v.z()) +
           ")";
  };
  const Eigen::Matrix3d axes_mm = grid.direction * grid.spacing_mm.asDiagonal();
  const std::string header =
      "NRRD0004\ntype: " + std::string(nrrd_name(component)) +
      "\ndimension: 3\nspace: left-posterior-superior\nsizes: " + format_exactly(grid.size) +
      "\nspace directions: " + vector(axes_mm.col(0)) + " " + vector(axes_mm.col(1)) + " " +
      vector(axes_mm.col(2)) +
      "\nkinds: domain domain domain\nendian: little\nencoding: raw\nspace origin: " +
      vector(grid.origin_mm) + "\n\n";
  return {header.begin(), header.end()};
}

}  // namespace usct::io
