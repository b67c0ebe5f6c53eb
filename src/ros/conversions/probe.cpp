#include "ros/conversions/probe.h"

#include "ros/conversions/checks.h"
#include "ros/conversions/poses.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

std::vector<double> scaled(const std::vector<double>& values, double factor) {
  std::vector<double> result(values);
  for (double& value : result) value *= factor;
  return result;
}

Array array_of(const msg::ProbeGeometry& message, const std::string& source) {
  if (message.type == msg::ProbeGeometry::TRACKED_LINEAR) {
    require_unused("line_angles", message.line_angles.empty(), source);
    require_unused("probe_radius", message.probe_radius == 0.0, source);
    return LinearArray{scaled(message.line_positions, kMmPerM)};
  }
  require(is_motorised(message) || message.type == msg::ProbeGeometry::TRACKED_CURVILINEAR, source,
          "'geometry.type' is " + std::to_string(message.type) + ", must be 1, 2 or 3");
  require_unused("line_positions", message.line_positions.empty(), source);
  require_unused("motor_radius", is_motorised(message) || message.motor_radius == 0.0, source);
  return CurvilinearArray{kMmPerM * message.probe_radius, message.line_angles};
}

}  // namespace

void require_unused(const char* name, bool unused, const std::string& source) {
  require(unused, source, "'" + std::string(name) + "' is set, but the type of probe has none");
}

bool is_motorised(const msg::ProbeGeometry& message) {
  return message.type == msg::ProbeGeometry::MOTORISED_CURVILINEAR;
}

msg::ProbeGeometry to_probe_message(const ScanGeometry& geometry) {
  msg::ProbeGeometry message;
  message.start_depth = geometry.axial.start_depth_mm / kMmPerM;
  message.sample_spacing = geometry.axial.spacing_mm / kMmPerM;
  if (const auto* curved = std::get_if<CurvilinearArray>(&geometry.array)) {
    message.type = msg::ProbeGeometry::TRACKED_CURVILINEAR;
    message.probe_radius = curved->probe_radius_mm / kMmPerM;
    message.line_angles = curved->line_angles_rad;
  } else {
    message.type = msg::ProbeGeometry::TRACKED_LINEAR;
    message.line_positions =
        scaled(std::get<LinearArray>(geometry.array).line_positions_mm, 1.0 / kMmPerM);
  }
  if (const auto* sweep = std::get_if<MotorSweep>(&geometry.motion)) {
    message.type = msg::ProbeGeometry::MOTORISED_CURVILINEAR;
    message.motor_radius = sweep->motor_radius_mm / kMmPerM;
  }
  return message;
}

Array array_from_message(const msg::ProbeGeometry& message, std::uint32_t lines,
                         const std::string& source) {
  Array array = array_of(message, source);
  require_count("geometry: lines", line_table(array).size(), lines, source);
  return array;
}

AxialSampling axial_from_message(const msg::ProbeGeometry& message, std::uint32_t samples,
                                 const std::string& source) {
  require(samples >= 2, source, "'samples' is " + std::to_string(samples) + ", must be >= 2");
  return {static_cast<int>(samples), kMmPerM * message.start_depth,
          kMmPerM * message.sample_spacing};
}

}  // namespace usct::ros_interface
