#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "io/bytes.h"
#include "io/description.h"
#include "io/sibling_file.h"
#include "io/ultrasound/prescan_nrrd_format.h"
#include "io/utc_time.h"
#include "ultrasound/probe_path.h"
#include "ultrasound/stray_frames.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"

namespace usct {
namespace {

/// The key `usct_geometry` is searched in this many bytes. Our writer puts it at the front; other
/// programs sort the keys, so that tables of any length may come before it.
constexpr std::size_t kPeekedBytes = std::size_t{1} << 20;

/// Adds the length and the turn of the path of the frames' origins, the largest step of the middle
/// of the field of view, and the time that it took.
void describe_tracking(const ScanGeometry& geometry, const TrackedSweep& sweep, io::Json& json) {
  const Eigen::Vector3d middle_mm = middle_of_field_mm(geometry.axial, geometry.array);
  double largest_mm = 0.0;
  double path_mm = 0.0;
  double turn_rad = 0.0;
  for (std::size_t i = 1; i < sweep.T_us_frame.size(); ++i) {
    const Eigen::Isometry3d step = sweep.T_us_frame[i - 1].inverse() * sweep.T_us_frame[i];
    path_mm += step.translation().norm();
    largest_mm = std::max(largest_mm, (step * middle_mm - middle_mm).norm());
    turn_rad += std::abs(Eigen::AngleAxisd(step.linear()).angle());
  }
  json["path_of_the_origin_mm"] = path_mm;
  json["path_turn_deg"] = turn_rad / kDegree;
  json["largest_step_of_the_middle_mm"] = largest_mm;
  if (!sweep.frame_times_s.empty())
    json["duration_s"] = sweep.frame_times_s.back() - sweep.frame_times_s.front();
}

void warn_of_duplicates(const PreScanVolume& volume, io::Json& json) {
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

const char* kind_of(const ScanGeometry& geometry) {
  if (geometry.is_motorised()) return "motorised curvilinear";
  return std::holds_alternative<LinearArray>(geometry.array) ? "tracked linear"
                                                             : "tracked curvilinear";
}

}  // namespace

bool is_prescan_nrrd(const std::filesystem::path& path) {
  try {
    const io::Bytes bytes = io::read_prefix(path, kPeekedBytes);
    const std::string_view text = io::text_view(bytes);
    const std::string_view header = text.substr(0, text.find("\n\n"));
    return header.substr(0, 4) == "NRRD" && header.find("\nusct_geometry:=") != header.npos;
  } catch (const InputError&) {
    return false;
  }
}

PreScanVolume read_prescan_nrrd(const std::filesystem::path& path) {
  return io::parse_prescan_nrrd(io::read_bytes(path), path.string(), [&](const std::string& name) {
    return io::read_bytes(io::sibling_file(path, name, "data file"));
  });
}

void write_prescan_nrrd(const PreScanVolume& volume, const std::filesystem::path& path) {
  volume.validate(path.string());
  if (!volume.acquisition_time.empty())
    io::check_utc_time(volume.acquisition_time, path.string(), "acquisition_time");
  io::write_bytes(path, io::format_prescan_nrrd(volume));
}

std::string describe_prescan_nrrd(const std::filesystem::path& path) {
  const PreScanVolume volume = read_prescan_nrrd(path);
  const ScanGeometry& geometry = volume.geometry;
  io::Json json;
  json["geometry"] = kind_of(geometry);
  json["samples_lines_frames"] = {geometry.samples(), geometry.lines(), geometry.frames()};
  json["sample_spacing_mm"] = geometry.axial.spacing_mm;
  json["depth_mm"] = {geometry.axial.start_depth_mm,
                      geometry.axial.depth_mm(geometry.samples() - 1)};
  io::describe_array(geometry.array, json);
  if (const auto* sweep = std::get_if<MotorSweep>(&geometry.motion))
    io::describe_motor(*sweep, json);
  else
    describe_tracking(geometry, std::get<TrackedSweep>(geometry.motion), json);
  json["field_of_view_mm"] = io::list(field_of_view(geometry).sizes().array().round().matrix());
  if (!volume.acquisition_time.empty()) json["acquisition_time"] = volume.acquisition_time;
  json["warnings"] = io::Json::array();
  io::describe_brightness(volume.voxels, json);
  warn_of_duplicates(volume, json);
  if (const std::vector<int> stray = stray_frames(beam_grid(geometry)); !stray.empty())
    json["warnings"].push_back(stray_words(stray, geometry.frames()));
  if (json.value("largest_step_of_the_middle_mm", 0.0) > kHoleMm)
    json["warnings"].push_back("frames that follow each other lie more than " +
                               formatted("%g", kHoleMm) + " mm apart: " + kWhyHoles);
  return io::as_text(json);
}

}  // namespace usct
