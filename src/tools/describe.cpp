#include "describe.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/file_kind.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"
#include "us_ct_registration/io/ultrasound/propello.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"

namespace usct::tools {
namespace {

using Json = nlohmann::ordered_json;

/// Above this fraction of full-scale samples the gain was too high to tell tissues apart.
constexpr double kSaturatedFraction = 0.02;

Json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// Where each index axis runs: "L" towards the patient's left, and so on; '~' where it is oblique.
std::string orientation_text(const Eigen::Matrix3d& direction) {
  const char* positive = "LPS";
  const char* negative = "RAI";
  std::string text;
  bool oblique = false;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Index along = 0;
    const double largest = direction.col(axis).cwiseAbs().maxCoeff(&along);
    text += direction(along, axis) > 0 ? positive[along] : negative[along];
    oblique = oblique || largest < 1.0 - 1e-6;
  }
  return text + (oblique ? " (oblique)" : "");
}

Json describe_grid(const Grid& grid) {
  Json json;
  json["size"] = {grid.size.x(), grid.size.y(), grid.size.z()};
  json["spacing_mm"] = list(grid.spacing_mm);
  json["origin_mm"] = list(grid.origin_mm);
  json["extent_mm"] = list(grid.spacing_mm.cwiseProduct(grid.size.cast<double>()));
  json["axes_run_to"] = orientation_text(grid.direction);
  json["direction"] = Json::array();
  for (int axis = 0; axis < 3; ++axis) json["direction"].push_back(list(grid.direction.col(axis)));
  return json;
}

template <typename T>
void describe_range(const std::vector<T>& voxels, Json& json) {
  if (voxels.empty()) return;
  const auto [low, high] = std::minmax_element(voxels.begin(), voxels.end());
  const double mean =
      std::accumulate(voxels.begin(), voxels.end(), 0.0) / static_cast<double>(voxels.size());
  json["range"] = {*low, *high};
  json["mean"] = mean;
  if (*low == *high) json["warnings"].push_back("every voxel has the same value");
}

void describe_brightness(const std::vector<std::uint8_t>& voxels, Json& json) {
  describe_range(voxels, json);
  const auto saturated = static_cast<double>(std::count(voxels.begin(), voxels.end(), 255)) /
                         static_cast<double>(std::max<std::size_t>(voxels.size(), 1));
  if (saturated > kSaturatedFraction)
    json["warnings"].push_back(std::to_string(std::lround(100 * saturated)) +
                               " % of the samples are saturated (255)");
}

Json describe_volume(const std::filesystem::path& path) {
  const VolumeInfo info = read_volume_info(path);
  Json json;
  json["format"] = info.format;
  json["component"] = info.component;
  json["compressed"] = info.compressed;
  json.update(describe_grid(info.grid));
  json["warnings"] = info.warnings;
  describe_range(read_volume<float>(path).voxels, json);
  return json;
}

/// A series without problems is read, so that its range is known and damage to its pixels shows.
void describe_series_voxels(const std::filesystem::path& path, const DicomSeries& series,
                            Json& json) {
  DicomReadOptions options;
  options.series_uid = series.series_uid;
  const LoadedCt ct = read_dicom_ct(path, options);
  json["warnings"] = ct.warnings;
  describe_range(ct.volume.voxels, json);
}

Json describe_series(const std::filesystem::path& path) {
  Json json;
  json["series"] = Json::array();
  for (const DicomSeries& series : find_dicom_series(path)) {
    Json entry;
    entry["series_uid"] = series.series_uid;
    entry["modality"] = series.modality;
    entry["files"] = series.files;
    if (series.is_ct) {
      entry["size"] = {series.columns, series.rows, series.slices};
      entry["spacing_mm"] = list(series.spacing_mm);
      entry["columns_run_to"] = list(series.axes.col(0));
      entry["rows_run_to"] = list(series.axes.col(1));
      entry["frame_of_reference_uid"] = series.frame_of_reference_uid;
      entry["transfer_syntax_uid"] = series.transfer_syntax_uid;
      entry["problems"] = series.problems;
      if (series.problems.empty()) describe_series_voxels(path, series, entry);
    }
    json["series"].push_back(entry);
  }
  return json;
}

void describe_table(const std::vector<double>& table, double unit, const std::string& name,
                    Json& json) {
  json[name] = {table.front() * unit, table.back() * unit};
  double least = std::abs(table[1] - table[0]);
  double most = least;
  for (std::size_t i = 2; i < table.size(); ++i) {
    least = std::min(least, std::abs(table[i] - table[i - 1]));
    most = std::max(most, std::abs(table[i] - table[i - 1]));
  }
  json[name + "_steps"] = {least * unit, most * unit};
}

/// Path of the frames' origins, and frames that repeat the one before.
void describe_tracking(const TrackedSweep& sweep, Json& json) {
  double path_mm = 0.0;
  double turn_rad = 0.0;
  for (std::size_t i = 1; i < sweep.T_us_frame.size(); ++i) {
    const Eigen::Isometry3d step = sweep.T_us_frame[i - 1].inverse() * sweep.T_us_frame[i];
    path_mm += step.translation().norm();
    turn_rad += std::abs(Eigen::AngleAxisd(step.linear()).angle());
  }
  json["path_of_the_origin_mm"] = path_mm;
  json["path_turn_deg"] = turn_rad / kDegree;
  if (!sweep.frame_times_s.empty())
    json["duration_s"] = sweep.frame_times_s.back() - sweep.frame_times_s.front();
}

void warn_of_duplicates(const PreScanVolume& volume, Json& json) {
  const auto frame_size = static_cast<std::ptrdiff_t>(volume.offset(0, 0, 1));
  int duplicates = 0;
  for (int f = 1; f < volume.geometry.frames(); ++f) {
    const auto begin = volume.voxels.begin() + f * frame_size;
    if (std::equal(begin, begin + frame_size, begin - frame_size)) ++duplicates;
  }
  if (duplicates > 0)
    json["warnings"].push_back(std::to_string(duplicates) + " of " +
                               std::to_string(volume.geometry.frames()) +
                               " frames repeat the image of the frame before");
}

Json describe_prescan(const std::filesystem::path& path) {
  const PreScanVolume volume = read_prescan_nrrd(path);
  const ScanGeometry& geometry = volume.geometry;
  Json json;
  json["geometry"] = geometry.is_motorised()                               ? "motorised curvilinear"
                     : std::holds_alternative<LinearArray>(geometry.array) ? "tracked linear"
                                                                           : "tracked curvilinear";
  json["samples_lines_frames"] = {geometry.samples(), geometry.lines(), geometry.frames()};
  json["sample_spacing_mm"] = geometry.axial.spacing_mm;
  json["depth_mm"] = {geometry.axial.start_depth_mm,
                      geometry.axial.depth_mm(geometry.samples() - 1)};
  if (const auto* array = std::get_if<CurvilinearArray>(&geometry.array)) {
    json["probe_radius_mm"] = array->probe_radius_mm;
    describe_table(array->line_angles_rad, 1.0 / kDegree, "line_angles_deg", json);
  } else {
    describe_table(std::get<LinearArray>(geometry.array).line_positions_mm, 1.0,
                   "line_positions_mm", json);
  }
  if (const auto* sweep = std::get_if<MotorSweep>(&geometry.motion)) {
    json["motor_radius_mm"] = sweep->motor_radius_mm;
    describe_table(sweep->frame_angles_rad, 1.0 / kDegree, "frame_angles_deg", json);
    json["frame_travel_deg"] = sweep->frame_travel_rad / kDegree;
  } else {
    describe_tracking(std::get<TrackedSweep>(geometry.motion), json);
  }
  json["field_of_view_mm"] = list(fan_grid(geometry, 1.0).size.cast<double>());
  if (!volume.acquisition_time.empty()) json["acquisition_time"] = volume.acquisition_time;
  json["warnings"] = Json::array();
  describe_brightness(volume.voxels, json);
  warn_of_duplicates(volume, json);
  return json;
}

std::vector<std::int16_t> int16_values(const std::vector<std::uint8_t>& little_endian) {
  std::vector<std::int16_t> values(little_endian.size() / 2);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<std::int16_t>(little_endian[2 * i] | little_endian[2 * i + 1] << 8);
  return values;
}

Json describe_sequence(const std::filesystem::path& path) {
  const IgsioSequence sequence = read_igsio(path);
  Json json;
  json["image_type"] = sequence.image_type;
  json["orientation"] = sequence.orientation;
  json["width_height_frames"] = {sequence.width, sequence.height, sequence.frames.size()};
  std::map<std::string, int> valid;
  int invalid_images = 0;
  int with_time = 0;
  for (const IgsioFrame& frame : sequence.frames) {
    if (frame.image_status != "OK") ++invalid_images;
    if (frame.timestamp_s) ++with_time;
    for (const auto& [name, transform] : frame.transforms) valid[name] += transform.valid() ? 1 : 0;
  }
  json["frames_with_time"] = with_time;
  if (with_time > 1 && sequence.frames.front().timestamp_s && sequence.frames.back().timestamp_s)
    json["duration_s"] = *sequence.frames.back().timestamp_s - *sequence.frames.front().timestamp_s;
  json["valid_transforms"] = valid;
  json["warnings"] = Json::array();
  if (invalid_images > 0)
    json["warnings"].push_back(std::to_string(invalid_images) + " images are not marked OK");
  if (sequence.element == IgsioElement::kUint8)
    describe_range(sequence.data, json);
  else
    describe_range(int16_values(sequence.data), json);
  return json;
}

Json describe_ultrasonix(const std::filesystem::path& path) {
  const UltrasonixSequence sequence = read_ultrasonix(path);
  const UltrasonixHeader& h = sequence.header;
  Json json;
  json["type"] = ultrasonix_type_name(h.type);
  json["w_h_frames"] = {h.w, h.h, h.frames};
  json["transmit_frequency_hz"] = h.txf;
  json["sampling_frequency_hz"] = h.sf;
  json["frames_per_second"] = h.dr;
  json["frame_tags"] = !sequence.frame_tags.empty();
  json["warnings"] = Json::array();
  describe_brightness(sequence.voxels, json);
  return json;
}

Json describe_propello(const std::filesystem::path& path) {
  const PropelloVolumes volumes = read_propello(path);
  const PropelloHeader& h = volumes.header;
  Json json;
  json["type"] = propello_type_name(h.type);
  json["volumes"] = h.volumes;
  json["w_h_frames"] = {h.w, h.h, h.fpv};
  json["frame_pitch_deg"] = h.degPerFr / 1000.0;
  json["warnings"] = Json::array();
  describe_brightness(volumes.voxels, json);
  return json;
}

Json describe_transform(const std::filesystem::path& path) {
  const Eigen::Isometry3d T_us_ct = read_T_us_ct(path);
  Json json;
  json["T_us_ct"] = Json::array();
  for (int row = 0; row < 4; ++row) {
    Json line = Json::array();
    for (int column = 0; column < 4; ++column) line.push_back(T_us_ct.matrix()(row, column));
    json["T_us_ct"].push_back(line);
  }
  json["rotation_deg"] = Eigen::AngleAxisd(T_us_ct.linear()).angle() / kDegree;
  json["translation_mm"] = T_us_ct.translation().norm();
  return json;
}

Json describe_result(const std::filesystem::path& path) {
  const RegistrationResult result = read_result(path);
  Json json;
  json["status"] = status_name(result.status);
  json["message"] = result.message;
  json["similarity"] = result.similarity;
  json["overlap"] = result.overlap;
  json["candidates"] = result.candidates.size();
  json["version"] = result.version;
  return json;
}

Json describe_points(const std::filesystem::path& path) {
  const std::vector<Eigen::Vector3d> points_mm = read_points_mm(path);
  Eigen::Vector3d low = points_mm.front();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& p_mm : points_mm) {
    low = low.cwiseMin(p_mm);
    high = high.cwiseMax(p_mm);
  }
  Json json;
  json["points"] = points_mm.size();
  json["from_mm"] = list(low);
  json["to_mm"] = list(high);
  return json;
}

Json describe_probe(const std::filesystem::path& path) {
  const ProbeConfig probe = read_probe_config(path);
  Json json;
  json["name"] = probe.name;
  json["lines"] = line_count(probe.array);
  if (const auto* array = std::get_if<CurvilinearArray>(&probe.array)) {
    json["probe_radius_mm"] = array->probe_radius_mm;
    describe_table(array->line_angles_rad, 1.0 / kDegree, "line_angles_deg", json);
  } else {
    describe_table(std::get<LinearArray>(probe.array).line_positions_mm, 1.0, "line_positions_mm",
                   json);
  }
  if (probe.motor) json["motor_radius_mm"] = probe.motor->motor_radius_mm;
  return json;
}

Json describe_as(FileKind kind, const std::filesystem::path& path) {
  switch (kind) {
    case FileKind::kDicom:
      return describe_series(path);
    case FileKind::kVolume:
      return describe_volume(path);
    case FileKind::kPreScan:
      return describe_prescan(path);
    case FileKind::kIgsio:
      return describe_sequence(path);
    case FileKind::kUltrasonix:
      return describe_ultrasonix(path);
    case FileKind::kPropello:
      return describe_propello(path);
    case FileKind::kTransform:
      return describe_transform(path);
    case FileKind::kResult:
      return describe_result(path);
    case FileKind::kPoints:
      return describe_points(path);
    case FileKind::kProbe:
      return describe_probe(path);
  }
  return {};
}

}  // namespace

nlohmann::ordered_json describe(const std::filesystem::path& path) {
  const FileKind kind = detect_file_kind(path);
  Json json;
  json["file"] = path.string();
  json["kind"] = file_kind_name(kind);
  json.update(describe_as(kind, path));
  return json;
}

}  // namespace usct::tools
