#include "io/ultrasound/igsio_format.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include "io/compression.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

constexpr std::string_view kFramePrefix = "Seq_Frame";
constexpr std::string_view kTransform = "Transform";
constexpr std::string_view kTransformStatus = "TransformStatus";

using Fields = std::map<std::string, std::string>;

struct Header {
  Fields fields;
  std::map<int, Fields> frames;
  std::size_t data_offset = 0;
};

bool ends_with(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

void insert(Fields& fields, std::string_view name, std::string_view value,
            const std::string& source) {
  if (!fields.emplace(name, value).second)
    throw InputError(source, "field " + in_quotes(name) + " is given twice");
}

void parse_field(std::string_view name, std::string_view value, Header& header,
                 const std::string& source) {
  if (name.substr(0, kFramePrefix.size()) != kFramePrefix)
    return insert(header.fields, name, value, source);
  const std::string_view rest = name.substr(kFramePrefix.size());
  const std::size_t underscore = rest.find('_');
  if (underscore == std::string_view::npos || underscore + 1 == rest.size())
    throw InputError(source, "field " + in_quotes(name) + " must be Seq_Frame<number>_<name>");
  const int frame = parse_int(rest.substr(0, underscore), source, "Seq_Frame number");
  insert(header.frames[frame], rest.substr(underscore + 1), value, source);
}

/// Parses lines `name = value`. The data begin after the line of ElementDataFile, the last one.
Header parse_header(const Bytes& bytes, const std::string& source) {
  const std::string_view text = text_view(bytes);
  Header header;
  while (header.data_offset < text.size()) {
    const std::size_t end = std::min(text.find('\n', header.data_offset), text.size());
    const std::string_view line =
        trimmed(text.substr(header.data_offset, end - header.data_offset));
    header.data_offset = std::min(end + 1, text.size());
    if (line.empty()) continue;
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos)
      throw InputError(source, "header line " + in_quotes(line) + " is not 'field = value'");
    const std::string_view name = trimmed(line.substr(0, equals));
    parse_field(name, trimmed(line.substr(equals + 1)), header, source);
    if (name == "ElementDataFile") return header;
  }
  throw InputError(source, "header has no field 'ElementDataFile'");
}

/// Takes a field out of the header, in which only the unknown fields remain, as text.
std::optional<std::string> take(Fields& fields, const std::string& name) {
  const auto node = fields.extract(name);
  return node.empty() ? std::nullopt : std::optional<std::string>(std::move(node.mapped()));
}

std::string take_required(Fields& fields, const std::string& name, const std::string& source) {
  if (auto value = take(fields, name)) return *value;
  throw InputError(source, "header has no field '" + name + "'");
}

bool take_flag(Fields& fields, const std::string& name, const std::string& source) {
  const std::string value = take(fields, name).value_or("False");
  if (value != "True" && value != "False")
    throw InputError(source, "'" + name + "' is " + in_quotes(value) + ", must be True or False");
  return value == "True";
}

struct SequenceSizes {
  int width;
  int height;
  int frames;
};

SequenceSizes take_sizes(Fields& fields, const std::string& source) {
  const int dimensions = parse_int(take_required(fields, "NDims", source), source, "NDims");
  if (dimensions != 2 && dimensions != 3)
    throw InputError(source, "'NDims' is " + std::to_string(dimensions) +
                                 ", must be 2 (one frame) or 3 (the last is time)");
  const std::string text = take_required(fields, "DimSize", source);
  const std::vector<std::string_view> parts = words(text);
  if (parts.size() != static_cast<std::size_t>(dimensions))
    throw InputError(source, "'DimSize' is " + in_quotes(text) + ", must be " +
                                 std::to_string(dimensions) + " numbers");
  return {parse_int(parts[0], source, "DimSize"), parse_int(parts[1], source, "DimSize"),
          dimensions == 3 ? parse_int(parts[2], source, "DimSize") : 1};
}

IgsioElement take_element(Fields& fields, const std::string& source) {
  const std::string type = take_required(fields, "ElementType", source);
  const bool big_endian = take_flag(fields, "BinaryDataByteOrderMSB", source) ||
                          take_flag(fields, "ElementByteOrderMSB", source);
  const std::string channels = take(fields, "ElementNumberOfChannels").value_or("1");
  if (channels != "1")
    throw InputError(source, "'ElementNumberOfChannels' is " + in_quotes(channels) + ", must be 1");
  if (take(fields, "BinaryData").value_or("True") != "True")
    throw InputError(source, "'BinaryData' must be True");
  if (type == "MET_UCHAR") return IgsioElement::kUint8;
  if (type != "MET_SHORT")
    throw InputError(source,
                     "'ElementType' is " + in_quotes(type) + ", must be MET_UCHAR or MET_SHORT");
  if (big_endian)
    throw InputError(source, "'BinaryDataByteOrderMSB' is True, must be False for 16-bit data");
  return IgsioElement::kInt16;
}

std::string take_orientation(Fields& fields, const std::string& source) {
  std::string text = take(fields, "UltrasoundImageOrientation").value_or("");
  static constexpr std::array<std::string_view, 8> kInPlane = {"MF", "MN", "UF", "UN",
                                                               "FM", "FU", "NM", "NU"};
  const std::string_view in_plane = std::string_view(text).substr(0, 2);
  const bool known = std::find(kInPlane.begin(), kInPlane.end(), in_plane) != kInPlane.end();
  const bool elevation =
      text.size() == 2 || (text.size() == 3 && (text[2] == 'A' || text[2] == 'D'));
  if (!text.empty() && !(known && elevation))
    throw InputError(source, "'UltrasoundImageOrientation' is " + in_quotes(text) +
                                 ", must be M or U and F or N, with or without A or D");
  return text;
}

std::string take_image_type(Fields& fields, const std::string& source) {
  std::string type = take(fields, "UltrasoundImageType").value_or("");
  static constexpr std::array<std::string_view, 5> kTypes = {"", "BRIGHTNESS", "RF_REAL",
                                                             "RF_IQ_LINE", "RF_I_LINE_Q_LINE"};
  if (std::find(kTypes.begin(), kTypes.end(), type) == kTypes.end())
    throw InputError(source, "'UltrasoundImageType' is " + in_quotes(type) +
                                 ", must be BRIGHTNESS, RF_REAL, RF_IQ_LINE or RF_I_LINE_Q_LINE");
  return type;
}

IgsioFrame parse_frame(const Fields& fields, int number, const std::string& source) {
  IgsioFrame frame;
  std::string where = "frame " + std::to_string(number) + " ";
  for (const auto& [name, value] : fields) {
    if (name == "Timestamp")
      frame.timestamp_s = parse_double(value, source, where + name);
    else if (name == "ImageStatus")
      frame.image_status = value;
    else if (ends_with(name, kTransformStatus))
      frame.transforms[name.substr(0, name.size() - kTransformStatus.size())].status = value;
    else if (ends_with(name, kTransform))
      frame.transforms[name.substr(0, name.size() - kTransform.size())].T =
          parse_affine(value, source, where + name);
    else
      frame.fields.emplace(name, value);
  }
  for (const auto& [name, transform] : frame.transforms) {
    std::string field = name;
    field += kTransform;
    if (fields.count(field) == 0)
      throw InputError(source, where.append("has a status, but no field ").append(field));
  }
  return frame;
}

std::vector<IgsioFrame> parse_frames(const std::map<int, Fields>& fields, int count,
                                     const std::string& source) {
  std::vector<IgsioFrame> frames(static_cast<std::size_t>(count));
  for (const auto& [number, frame] : fields) {
    if (number < 0 || number >= count)
      throw InputError(source, "has fields of frame " + std::to_string(number) +
                                   ", 'DimSize' says " + std::to_string(count) + " frames");
    frames[static_cast<std::size_t>(number)] = parse_frame(frame, number, source);
  }
  return frames;
}

Bytes read_data(Header& header, std::uint64_t expected, Bytes bytes, const std::string& source,
                const ReadDetached& read_detached) {
  std::size_t offset = header.data_offset;
  const std::string name = take_required(header.fields, "ElementDataFile", source);
  if (name.substr(0, 4) == "LIST" || name.find('%') != std::string::npos)
    throw InputError(source,
                     "'ElementDataFile' is " + in_quotes(name) + ", must be LOCAL or one file");
  if (name != "LOCAL" && name != "Local" && name != "local") {
    bytes = read_detached(name);
    offset = 0;
  }
  const bool compressed = take_flag(header.fields, "CompressedData", source);
  const auto compressed_size = take(header.fields, "CompressedDataSize");
  if (compressed) {
    if (compressed_size && *compressed_size != std::to_string(bytes.size() - offset))
      throw InputError(source, "'CompressedDataSize' is " + in_quotes(*compressed_size) +
                                   ", the data have " + std::to_string(bytes.size() - offset) +
                                   " bytes");
    return decompress(bytes, offset, expected, Compression::kZlib, source);
  }
  if (bytes.size() - offset != expected)
    throw InputError(source, "'DimSize' asks for " + std::to_string(expected) +
                                 " bytes of data, there are " +
                                 std::to_string(bytes.size() - offset));
  bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(offset));
  return bytes;
}

void append_field(const std::string& name, const std::string& value, const std::string& source,
                  std::string& text) {
  if ((name + value).find_first_of("\r\n") != std::string::npos ||
      name.find('=') != std::string::npos)
    throw InputError(source, "field " + in_quotes(name) + " cannot stand in a header");
  text += name + " = " + value + "\n";
}

/// A file of one frame states these fields for two axes. Such values must not be written to a file
/// with three axes.
bool fits_three_axes(const std::string& name, const std::string& value) {
  static const std::map<std::string, std::size_t> kWords = {{"CenterOfRotation", 3},
                                                            {"ElementSpacing", 3},
                                                            {"Kinds", 3},
                                                            {"Offset", 3},
                                                            {"TransformMatrix", 9}};
  const auto it = kWords.find(name);
  return it == kWords.end() || words(value).size() == it->second;
}

void append_frame(const IgsioFrame& frame, std::size_t number, const std::string& source,
                  std::string& text) {
  std::string digits = std::to_string(number);
  digits.insert(0, digits.size() < 4 ? 4 - digits.size() : 0, '0');
  const std::string prefix = std::string(kFramePrefix) + digits + "_";
  for (const auto& [name, transform] : frame.transforms) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = transform.T.matrix();
    append_field(prefix + name + std::string(kTransform),
                 format_doubles({matrix.data(), matrix.data() + matrix.size()}), source, text);
    if (!transform.status.empty())
      append_field(prefix + name + std::string(kTransformStatus), transform.status, source, text);
  }
  for (const auto& [name, value] : frame.fields) append_field(prefix + name, value, source, text);
  if (frame.timestamp_s)
    append_field(prefix + "Timestamp", format_double(*frame.timestamp_s), source, text);
  if (!frame.image_status.empty())
    append_field(prefix + "ImageStatus", frame.image_status, source, text);
}

}  // namespace

Eigen::Affine3d parse_affine(std::string_view text, const std::string& source,
                             const std::string& field) {
  const std::vector<double> v = parse_doubles(text, source, field);
  if (v.size() != 16)
    throw InputError(source, "'" + field + "' has " + std::to_string(v.size()) +
                                 " numbers, must have 16 (4x4, row by row)");
  if (v[12] != 0.0 || v[13] != 0.0 || v[14] != 0.0 || v[15] != 1.0)
    throw InputError(source, "last row of '" + field + "' is not 0 0 0 1");
  Eigen::Affine3d T;
  T.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(v.data());
  return T;
}

IgsioSequence parse_igsio(Bytes bytes, const std::string& source,
                          const ReadDetached& read_detached) {
  Header header = parse_header(bytes, source);
  Fields& fields = header.fields;
  if (take_required(fields, "ObjectType", source) != "Image")
    throw InputError(source, "'ObjectType' must be Image");
  const SequenceSizes sizes = take_sizes(fields, source);
  IgsioSequence sequence;
  sequence.width = sizes.width;
  sequence.height = sizes.height;
  sequence.element = take_element(fields, source);
  sequence.orientation = take_orientation(fields, source);
  sequence.image_type = take_image_type(fields, source);
  const std::uint64_t expected =
      size_product({sizes.width, sizes.height, sizes.frames,
                    static_cast<std::int64_t>(sequence.bytes_per_pixel())},
                   source, "DimSize");
  sequence.data = read_data(header, expected, std::move(bytes), source, read_detached);
  sequence.frames = parse_frames(header.frames, sizes.frames, source);
  sequence.fields = std::move(fields);
  return sequence;
}

Bytes format_igsio(const IgsioSequence& sequence, bool compressed, const std::string& source) {
  const std::uint64_t expected = size_product(
      {sequence.width, sequence.height, static_cast<std::int64_t>(sequence.bytes_per_pixel()),
       static_cast<std::int64_t>(sequence.frames.size())},
      source, "width x height x frames");
  if (sequence.data.size() != expected)
    throw InputError(source, "holds " + std::to_string(sequence.data.size()) +
                                 " bytes of data, must hold " + std::to_string(expected));
  const Bytes data = compressed ? compress(sequence.data, Compression::kZlib) : sequence.data;
  std::string text = "ObjectType = Image\nNDims = 3\n";
  for (const auto& [name, value] : sequence.fields)
    if (fits_three_axes(name, value)) append_field(name, value, source, text);
  text += "BinaryData = True\nBinaryDataByteOrderMSB = False\n";
  text += std::string("CompressedData = ") + (compressed ? "True" : "False") + "\n";
  if (compressed) text += "CompressedDataSize = " + std::to_string(data.size()) + "\n";
  text += "DimSize = " + std::to_string(sequence.width) + " " + std::to_string(sequence.height) +
          " " + std::to_string(sequence.frames.size()) + "\n";
  text += std::string("ElementType = ") +
          (sequence.element == IgsioElement::kUint8 ? "MET_UCHAR" : "MET_SHORT") + "\n";
  if (!sequence.orientation.empty())
    append_field("UltrasoundImageOrientation", sequence.orientation, source, text);
  if (!sequence.image_type.empty())
    append_field("UltrasoundImageType", sequence.image_type, source, text);
  for (std::size_t i = 0; i < sequence.frames.size(); ++i)
    append_frame(sequence.frames[i], i, source, text);
  text += "ElementDataFile = LOCAL\n";
  Bytes bytes(text.begin(), text.end());
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

}  // namespace usct::io
