#include "io/description.h"

#include <cmath>

#include "us_ct_registration/geometry/angles.h"

namespace usct::io {
namespace {

/// Above this fraction of full-scale samples the gain was too high to tell tissues apart.
constexpr double kSaturatedFraction = 0.02;

/// First and last value, and the least and the largest step between neighbours.
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

}  // namespace

std::string as_text(const Json& description) {
  return description.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

void describe_brightness(const std::vector<std::uint8_t>& voxels, Json& json) {
  describe_range(voxels, json);
  const auto saturated = static_cast<double>(std::count(voxels.begin(), voxels.end(), 255)) /
                         static_cast<double>(std::max<std::size_t>(voxels.size(), 1));
  if (saturated > kSaturatedFraction)
    json["warnings"].push_back(std::to_string(std::lround(100 * saturated)) +
                               " % of the samples are saturated (255)");
}

void describe_array(const Array& array, Json& json) {
  if (const auto* curved = std::get_if<CurvilinearArray>(&array)) {
    json["probe_radius_mm"] = curved->probe_radius_mm;
    describe_table(curved->line_angles_rad, 1.0 / kDegree, "line_angles_deg", json);
  } else {
    describe_table(std::get<LinearArray>(array).line_positions_mm, 1.0, "line_positions_mm", json);
  }
}

void describe_motor(const MotorSweep& sweep, Json& json) {
  json["motor_radius_mm"] = sweep.motor_radius_mm;
  describe_table(sweep.frame_angles_rad, 1.0 / kDegree, "frame_angles_deg", json);
  json["frame_travel_deg"] = sweep.frame_travel_rad / kDegree;
}

}  // namespace usct::io
