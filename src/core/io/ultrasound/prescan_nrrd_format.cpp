#include "io/ultrasound/prescan_nrrd_format.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <set>
#include <string_view>

#include "io/compression.h"
#include "io/utc_time.h"
#include "io/volumes/nrrd_header.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::io {
namespace {

constexpr const char* kGeometryKey = "usct_geometry";
constexpr const char* kMotorised = "motorised_curvilinear";
constexpr const char* kTrackedCurvilinear = "tracked_curvilinear";
constexpr const char* kTrackedLinear = "tracked_linear";
constexpr std::size_t kPoseNumbers = 12;

struct Sizes {
  int samples;
  int lines;
  int frames;
};

/// The key/value pairs of a header. The parser asks for each key by name, and refuses all other
/// geometry keys.
class Keys {
 public:
  Keys(const std::map<std::string, std::string>& keys, std::string source)
      : keys_(keys), source_(std::move(source)) {}

  const std::string* find(const std::string& key) {
    used_.insert(key);
    const auto it = keys_.find(key);
    return it == keys_.end() ? nullptr : &it->second;
  }
  const std::string& text(const std::string& key) {
    if (const std::string* value = find(key)) return *value;
    throw InputError(source_, "key '" + key + "' is missing");
  }
  double number(const std::string& key) { return parse_double(text(key), source_, key); }
  std::vector<double> table(const std::string& key, int count) {
    std::vector<double> values = parse_doubles(text(key), source_, key);
    if (values.size() != static_cast<std::size_t>(count))
      throw InputError(source_, "'" + key + "' has " + std::to_string(values.size()) +
                                    " entries, must have " + std::to_string(count));
    return values;
  }
  /// Angles from a table, or from a pitch, with which they are evenly spaced and centred on zero.
  std::vector<double> angles_rad(const std::string& table_key, const std::string& pitch_key,
                                 int count) {
    const bool has_table = find(table_key) != nullptr;
    if (has_table == (find(pitch_key) != nullptr))
      throw InputError(source_, "must have one of '" + table_key + "' and '" + pitch_key +
                                    "', has " + (has_table ? "both" : "neither"));
    return radians(has_table ? table(table_key, count) : centred_table(count, number(pitch_key)));
  }
  void refuse_unknown() const {
    for (const auto& [key, value] : keys_)
      if (used_.count(key) == 0 && looks_like_geometry(key))
        throw InputError(source_,
                         "key " + in_quotes(key) + " is unknown, or not one of this geometry");
  }

 private:
  /// Other programs may add keys of their own, but a misspelt geometry key must not pass as one of
  /// these.
  static bool looks_like_geometry(std::string_view key) {
    constexpr std::array<std::string_view, 6> kUnits = {"_mm", "_deg", "_rad", "_s", "_m", "_hz"};
    return key.substr(0, 5) == "usct_" ||
           std::any_of(kUnits.begin(), kUnits.end(), [&](std::string_view unit) {
             return key.size() > unit.size() && key.substr(key.size() - unit.size()) == unit;
           });
  }

  const std::map<std::string, std::string>& keys_;
  std::string source_;
  std::set<std::string> used_;
};

Sizes parse_sizes(const NrrdHeader& header, const std::string& source) {
  if (parse_int(header.field("dimension", source), source, "dimension") != 3)
    throw InputError(source, "'dimension' is " + in_quotes(header.field("dimension", source)) +
                                 ", must be 3 (samples, lines, frames)");
  const std::string& text = header.field("sizes", source);
  const std::vector<std::string_view> parts = words(text);
  if (parts.size() != 3)
    throw InputError(source, "'sizes' is " + in_quotes(text) + ", must be three numbers");
  return {parse_int(parts[0], source, "sizes"), parse_int(parts[1], source, "sizes"),
          parse_int(parts[2], source, "sizes")};
}

void check_type(const NrrdHeader& header, const std::string& source) {
  static const std::set<std::string> kNames = {"unsigned char", "uchar", "uint8", "uint8_t"};
  const std::string& type = header.field("type", source);
  if (kNames.count(type) == 0)
    throw InputError(source, "'type' is " + in_quotes(type) + ", must be unsigned char");
  for (const char* skip : {"line skip", "lineskip", "byte skip", "byteskip"})
    if (header.fields.count(skip) != 0)
      throw InputError(source, "'" + std::string(skip) + "' is not supported");
}

std::optional<std::string> data_file(const NrrdHeader& header, const std::string& source) {
  std::optional<std::string> name;
  for (const char* spelling : {"data file", "datafile"}) {
    const auto it = header.fields.find(spelling);
    if (it == header.fields.end()) continue;
    if (name) throw InputError(source, "'data file' is given twice in the header");
    name = it->second;
  }
  // "LIST" and patterns such as "slice%03d.raw 0 9 1" name several files.
  if (name && (name->substr(0, 4) == "LIST" || name->find('%') != std::string::npos))
    throw InputError(source,
                     "'data file' is " + in_quotes(*name) + ", must be the name of one file");
  return name;
}

std::vector<std::uint8_t> read_voxels(const NrrdHeader& header, std::uint64_t expected, Bytes bytes,
                                      const std::string& source,
                                      const ReadDetached& read_detached) {
  std::size_t offset = header.data_offset;
  if (const auto name = data_file(header, source)) {
    bytes = read_detached(*name);
    offset = 0;
  }
  const std::string& encoding = header.field("encoding", source);
  if (encoding == "gzip" || encoding == "gz")
    return decompress(bytes, offset, expected, Compression::kGzip, source);
  if (encoding != "raw")
    throw InputError(source, "'encoding' is " + in_quotes(encoding) + ", must be raw or gzip");
  if (bytes.size() - offset != expected)
    throw InputError(source, "'sizes' ask for " + std::to_string(expected) +
                                 " bytes of data, there are " +
                                 std::to_string(bytes.size() - offset));
  bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(offset));
  return bytes;
}

Eigen::Isometry3d parse_pose(std::string_view text, std::size_t frame, const std::string& source) {
  const std::vector<double> v = parse_doubles(text, source, "frame_poses_mm");
  if (v.size() != kPoseNumbers)
    throw InputError(source, "'frame_poses_mm' of frame " + std::to_string(frame) + " has " +
                                 std::to_string(v.size()) + " numbers, must have 12 (3x4)");
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.matrix().topRows<3>() =
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(v.data());
  return T;
}

TrackedSweep parse_tracked(Keys& keys, int frames, const std::string& source) {
  TrackedSweep sweep;
  const std::vector<std::string_view> poses = split(keys.text("frame_poses_mm"), ';');
  if (poses.size() != static_cast<std::size_t>(frames))
    throw InputError(source, "'frame_poses_mm' has " + std::to_string(poses.size()) +
                                 " poses, must have " + std::to_string(frames));
  for (std::size_t i = 0; i < poses.size(); ++i)
    sweep.T_us_frame.push_back(parse_pose(poses[i], i, source));
  if (keys.find("frame_times_s") != nullptr)
    sweep.frame_times_s = keys.table("frame_times_s", frames);
  return sweep;
}

MotorSweep parse_motor(Keys& keys, int frames) {
  MotorSweep sweep;
  sweep.motor_radius_mm = keys.number("motor_radius_mm");
  sweep.frame_angles_rad = keys.angles_rad("frame_angles_deg", "frame_pitch_deg", frames);
  if (keys.find("frame_travel_deg") != nullptr)
    sweep.frame_travel_rad = radians(keys.number("frame_travel_deg"));
  return sweep;
}

ScanGeometry parse_geometry(Keys& keys, const Sizes& sizes, const std::string& source) {
  const std::string& kind = keys.text(kGeometryKey);
  if (kind != kMotorised && kind != kTrackedCurvilinear && kind != kTrackedLinear)
    throw InputError(source, "'" + std::string(kGeometryKey) + "' is " + in_quotes(kind) +
                                 ", must be motorised_curvilinear, tracked_curvilinear or "
                                 "tracked_linear");
  ScanGeometry geometry;
  geometry.axial = {sizes.samples, keys.number("start_depth_mm"), keys.number("sample_spacing_mm")};
  if (kind == kTrackedLinear) {
    geometry.array = LinearArray{keys.table("line_positions_mm", sizes.lines)};
  } else {
    geometry.array =
        CurvilinearArray{keys.number("probe_radius_mm"),
                         keys.angles_rad("line_angles_deg", "line_pitch_deg", sizes.lines)};
  }
  if (kind == kMotorised)
    geometry.motion = parse_motor(keys, sizes.frames);
  else
    geometry.motion = parse_tracked(keys, sizes.frames, source);
  return geometry;
}

void append_array(const Array& array, std::string& text) {
  if (const auto* linear = std::get_if<LinearArray>(&array)) {
    text += "line_positions_mm:=" + format_doubles(linear->line_positions_mm) + "\n";
    return;
  }
  const auto& curved = std::get<CurvilinearArray>(array);
  text += "probe_radius_mm:=" + format_double(curved.probe_radius_mm) + "\n";
  text += "line_angles_deg:=" + format_doubles(degrees(curved.line_angles_rad)) + "\n";
}

void append_motion(const MotorSweep& sweep, std::string& text) {
  text += "motor_radius_mm:=" + format_double(sweep.motor_radius_mm) + "\n";
  text += "frame_angles_deg:=" + format_doubles(degrees(sweep.frame_angles_rad)) + "\n";
  text += "frame_travel_deg:=" + format_double(degrees(sweep.frame_travel_rad)) + "\n";
}

void append_motion(const TrackedSweep& sweep, std::string& text) {
  text += "frame_poses_mm:=";
  for (std::size_t i = 0; i < sweep.T_us_frame.size(); ++i) {
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> pose =
        sweep.T_us_frame[i].matrix().topRows<3>();
    text += (i == 0 ? "" : "; ") +
            format_doubles(std::vector<double>(pose.data(), pose.data() + kPoseNumbers));
  }
  text += "\n";
  if (!sweep.frame_times_s.empty())
    text += "frame_times_s:=" + format_doubles(sweep.frame_times_s) + "\n";
}

const char* kind_of(const ScanGeometry& geometry) {
  if (geometry.is_motorised()) return kMotorised;
  return std::holds_alternative<LinearArray>(geometry.array) ? kTrackedLinear : kTrackedCurvilinear;
}

}  // namespace

PreScanVolume parse_prescan_nrrd(Bytes bytes, const std::string& source,
                                 const ReadDetached& read_detached) {
  const NrrdHeader header = parse_nrrd_header(bytes, source);
  Keys keys(header.keys, source);
  keys.text(kGeometryKey);  // for any other NRRD, the message is that this key is missing
  check_type(header, source);
  const Sizes sizes = parse_sizes(header, source);
  const std::uint64_t expected =
      size_product({sizes.samples, sizes.lines, sizes.frames}, source, "sizes");
  PreScanVolume volume;
  // The data are read before the tables are made, because they prove that the sizes are right.
  volume.voxels = read_voxels(header, expected, std::move(bytes), source, read_detached);
  volume.geometry = parse_geometry(keys, sizes, source);
  if (const std::string* time = keys.find("acquisition_time")) {
    check_utc_time(*time, source, "acquisition_time");
    volume.acquisition_time = *time;
  }
  keys.refuse_unknown();
  volume.validate(source);
  return volume;
}

Bytes format_prescan_nrrd(const PreScanVolume& volume) {
  const ScanGeometry& geometry = volume.geometry;
  std::string text =
      "NRRD0005\n"
      "# Pre-scan ultrasound of us_ct_registration: samples x lines x frames\n"
      "type: unsigned char\n"
      "dimension: 3\n";
  text += "sizes: " + std::to_string(geometry.samples()) + " " + std::to_string(geometry.lines()) +
          " " + std::to_string(geometry.frames()) + "\n";
  text += "encoding: gzip\n";
  text += std::string(kGeometryKey) + ":=" + kind_of(geometry) + "\n";
  text += "start_depth_mm:=" + format_double(geometry.axial.start_depth_mm) + "\n";
  text += "sample_spacing_mm:=" + format_double(geometry.axial.spacing_mm) + "\n";
  append_array(geometry.array, text);
  std::visit([&](const auto& motion) { append_motion(motion, text); }, geometry.motion);
  if (!volume.acquisition_time.empty())
    text += "acquisition_time:=" + volume.acquisition_time + "\n";
  text += "\n";
  Bytes bytes(text.begin(), text.end());
  const Bytes data = compress(volume.voxels, Compression::kGzip);
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

}  // namespace usct::io
