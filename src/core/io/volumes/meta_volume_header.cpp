// The header of MetaImage, as ITK's MetaIO writes and reads it.
#include <map>

#include "io/bytes.h"
#include "io/format.h"
#include "io/header_fields.h"
#include "io/sibling_file.h"
#include "io/volumes/volume_header.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

constexpr double kUnitTolerance = 1e-3;

const std::map<std::string, Component>& meta_types() {
  static const std::map<std::string, Component> names = {
      {"MET_CHAR", Component::kInt8},       {"MET_UCHAR", Component::kUint8},
      {"MET_SHORT", Component::kInt16},     {"MET_USHORT", Component::kUint16},
      {"MET_INT", Component::kInt32},       {"MET_UINT", Component::kUint32},
      {"MET_LONG_LONG", Component::kInt64}, {"MET_ULONG_LONG", Component::kUint64},
      {"MET_FLOAT", Component::kFloat32},   {"MET_DOUBLE", Component::kFloat64}};
  return names;
}

struct MetaText {
  HeaderFields fields;
  /// First byte after the line of ElementDataFile, which ends the header.
  std::size_t data_begin;
};

MetaText read_text(const fs::path& path) {
  const Bytes bytes = read_prefix(path, kLongestHeader);
  const std::string_view all = text_view(bytes);
  MetaText result{HeaderFields(path.string()), 0};
  while (!result.fields.find("ElementDataFile")) {
    const std::size_t begin = result.data_begin;
    const std::size_t end = std::min(all.find('\n', begin), all.size());
    const std::string_view line = trimmed(all.substr(begin, end - begin));
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos && !line.empty())
      throw InputError(path.string(),
                       "header line " + in_quotes(line) + " must be 'Field = value'");
    if (!line.empty()) result.fields.add(line.substr(0, equals), line.substr(equals + 1));
    result.data_begin = std::min(end + 1, all.size());
    if (end == all.size()) break;
  }
  result.fields.require("ElementDataFile");
  return result;
}

/// MetaIO knows several names of some fields. Returns the one that the header uses, or the first.
/// Throws InputError if it uses two of them with different values.
std::string spelling(const HeaderFields& fields, std::initializer_list<const char*> names) {
  std::optional<std::string> used;
  for (const char* name : names) {
    if (!fields.find(name)) continue;
    if (used && fields.find(name) != fields.find(*used))
      fields.refuse(name, "the same as '" + *used + "', " + *fields.find(*used));
    if (!used) used = name;
  }
  return used.value_or(*names.begin());
}

bool is_true(const HeaderFields& fields, const std::string& field) {
  const std::string& value = fields.require(field);
  if (value == "True" || value == "true" || value == "1") return true;
  if (value == "False" || value == "false" || value == "0") return false;
  fields.refuse(field, "True or False");
}

/// Throws InputError if a field says that the file is no plain volume of scalars in millimetres.
void check_is_plain_volume(const HeaderFields& fields) {
  const auto must_be = [&](const std::string& field, const std::string& value, bool required) {
    if (required || fields.find(field))
      if (fields.require(field) != value) fields.refuse(field, value);
  };
  must_be("ObjectType", "Image", true);
  must_be("NDims", "3", true);
  must_be("ElementNumberOfChannels", "1", false);
  must_be("DistanceUnits", "mm", false);
  const auto must_equal = [&](const std::string& field, double value) {
    if (fields.find(field) && fields.require_doubles(field, 1)[0] != value)
      fields.refuse(field, format(value));
  };
  must_equal("ElementToIntensityFunctionSlope", 1.0);
  must_equal("ElementToIntensityFunctionOffset", 0.0);
  if (fields.find("BinaryData") && !is_true(fields, "BinaryData"))
    fields.refuse("BinaryData", "True");
}

Grid meta_grid(const HeaderFields& fields) {
  const std::string matrix_field = spelling(fields, {"TransformMatrix", "Orientation", "Rotation"});
  const std::string origin_field = spelling(fields, {"Offset", "Position", "Origin"});
  const std::vector<int> sizes = fields.require_ints("DimSize", 3);
  const std::vector<double> matrix = fields.require_doubles(matrix_field, 9);
  const std::vector<double> origin = fields.require_doubles(origin_field, 3);
  const std::vector<double> spacing = fields.require_doubles("ElementSpacing", 3);
  // The matrix lists, for each index axis, the three components of its direction in LPS.
  const Eigen::Matrix3d direction = Eigen::Map<const Eigen::Matrix3d>(matrix.data());
  const Eigen::Vector3d spacing_mm = Eigen::Map<const Eigen::Vector3d>(spacing.data());
  if ((spacing_mm.array() <= 0.0).any()) fields.refuse("ElementSpacing", "> 0");
  if (((direction.colwise().norm().array() - 1.0).abs() > kUnitTolerance).any())
    fields.refuse(matrix_field, "unit vectors");
  return grid_from_axes(fields.source(), matrix_field, {sizes[0], sizes[1], sizes[2]},
                        direction.colwise().normalized() * spacing_mm.asDiagonal(),
                        Eigen::Map<const Eigen::Vector3d>(origin.data()));
}

Component meta_component(const HeaderFields& fields) {
  const auto found = meta_types().find(fields.require("ElementType"));
  if (found != meta_types().end()) return found->second;
  std::string known;  // MET_LONG is not: its size depends on the machine that wrote it
  for (const auto& [name, component] : meta_types()) known += (known.empty() ? "" : ", ") + name;
  fields.refuse("ElementType", "one of " + known);
}

void locate_data(const fs::path& path, const MetaText& text, VolumeHeader& header) {
  const HeaderFields& fields = text.fields;
  const std::string& name = fields.require("ElementDataFile");
  const bool local = name == "LOCAL" || name == "Local" || name == "local";
  if (name == "LIST" || name.find('%') != std::string::npos || name.empty())
    fields.refuse("ElementDataFile", "LOCAL or the name of one file");
  header.data_file = local ? path : sibling_file(path, name, "ElementDataFile");
  header.begin = local ? text.data_begin : 0;
  if (!fields.find("HeaderSize")) return;
  const int header_size = fields.require_ints("HeaderSize", 1)[0];
  if (header_size < -1 || (header_size > 0 && local)) fields.refuse("HeaderSize", ">= -1");
  if (header_size > 0) header.begin = static_cast<std::uintmax_t>(header_size);
  if (header_size == -1) {  // the voxels are the end of the file
    const std::uintmax_t bytes = fs::file_size(header.data_file);
    if (bytes >= header.voxel_bytes()) header.begin = bytes - header.voxel_bytes();
  }
}

/// Readers trim the name and end it with the line; for MetaIO a '%' makes it a pattern, and LIST at
/// its begin announces a list of files.
void check_data_file_name(const std::string& source, const std::string& name) {
  if (trimmed(name) != name || name.find_first_of("%\r\n") != std::string::npos ||
      name.substr(0, 4) == "LIST")
    throw InputError(source,
                     "the file with its voxels would be " + in_quotes(name) +
                         ", must have a name without '%' and line breaks that begins "
                         "neither with a blank nor with LIST: choose another name, or .mha");
}

}  // namespace

VolumeHeader read_meta_header(const fs::path& path) {
  const MetaText text = read_text(path);
  const HeaderFields& fields = text.fields;
  check_is_plain_volume(fields);
  VolumeHeader header;
  header.format = "MetaImage";
  header.grid = meta_grid(fields);
  header.component = meta_component(fields);
  if (bytes_of(header.component) > 1)
    header.big_endian =
        is_true(fields, spelling(fields, {"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}));
  if (fields.find("CompressedData") && is_true(fields, "CompressedData"))
    header.encoding = Encoding::kZlib;
  locate_data(path, text, header);
  check_data_size(path.string(), "DimSize", header);
  return header;
}

Bytes meta_header(const std::string& source, const Grid& grid, Component component,
                  const std::string& data_file) {
  check_data_file_name(source, data_file);
  std::string type;
  for (const auto& [name, known] : meta_types())
    if (known == component) type = name;
  const std::string header =
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
      "CompressedData = False\nTransformMatrix = " +
      format_exactly(grid.direction) + "\nOffset = " + format_exactly(grid.origin_mm) +
      "\nCenterOfRotation = 0 0 0\nElementSpacing = " + format_exactly(grid.spacing_mm) +
      "\nDimSize = " + format_exactly(grid.size) + "\nElementType = " + type +
      "\nElementDataFile = " + data_file + "\n";
  return {header.begin(), header.end()};
}

}  // namespace usct::io
