#include "io/description.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

using io::Json;

/// Direction of each index axis: "L" towards the patient's left, and so on. " (oblique)" follows if
/// an axis is not parallel to one of the patient's.
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

void describe_grid(const Grid& grid, Json& json) {
  json["size"] = {grid.size.x(), grid.size.y(), grid.size.z()};
  json["spacing_mm"] = io::list(grid.spacing_mm);
  json["origin_mm"] = io::list(grid.origin_mm);
  json["extent_mm"] = io::list(grid.spacing_mm.cwiseProduct(grid.size.cast<double>()));
  json["axes_run_to"] = orientation_text(grid.direction);
  json["direction"] = Json::array();
  for (int axis = 0; axis < 3; ++axis)
    json["direction"].push_back(io::list(grid.direction.col(axis)));
}

}  // namespace

std::string describe_volume(const std::filesystem::path& path) {
  const VolumeInfo info = read_volume_info(path);
  Json json;
  json["format"] = info.format;
  json["component"] = info.component;
  json["compressed"] = info.compressed;
  describe_grid(info.grid, json);
  json["warnings"] = info.warnings;
  io::describe_range(read_volume<float>(path).voxels, json);
  return io::as_text(json);
}

}  // namespace usct
