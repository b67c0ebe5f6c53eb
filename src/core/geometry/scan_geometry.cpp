#include "us_ct_registration/geometry/scan_geometry.h"

#include <cmath>

#include "geometry/frame_times.h"
#include "require.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

/// Recorded poses are rounded more coarsely than the result of a registration, so their tolerance
/// is wider.
constexpr double kPoseTolerance = 1e-4;

std::string in_degrees(double angle_rad) { return std::to_string(degrees(angle_rad)) + " degrees"; }

void validate_axial(const AxialSampling& axial, const std::string& source) {
  if (axial.samples < 2)
    throw InputError(source,
                     "has " + std::to_string(axial.samples) + " samples per line, must be >= 2");
  require_positive(source, "sample_spacing_mm", axial.spacing_mm);
  require_not_negative(source, "start_depth_mm", axial.start_depth_mm);
}

/// The angles beyond either end of the table by `extra_rad` are tested as well.
void require_within_right_angle(const std::vector<double>& angles_rad, double extra_rad,
                                const std::string& source, const std::string& field) {
  for (std::size_t i = 0; i < angles_rad.size(); ++i)
    if (std::abs(angles_rad[i]) + extra_rad >= 0.5 * kPi)
      throw InputError(
          source,
          "'" + field + "' entry " + std::to_string(i) + " is " + in_degrees(angles_rad[i]) +
              (extra_rad > 0.0 ? ", with half the frame's travel of " + in_degrees(extra_rad)
                               : std::string()) +
              ", must be within +-90 degrees");
}

void validate_array(const Array& array, const std::string& source) {
  if (const auto* linear = std::get_if<LinearArray>(&array)) {
    require_monotonic(linear->line_positions_mm, source, "line_positions_mm");
    return;
  }
  const auto& curved = std::get<CurvilinearArray>(array);
  require_positive(source, "probe_radius_mm", curved.probe_radius_mm);
  require_monotonic(curved.line_angles_rad, source, "line_angles_rad");
  require_within_right_angle(curved.line_angles_rad, 0.0, source, "line_angles_rad");
}

void validate_motor(const MotorSweep& sweep, const ScanGeometry& geometry,
                    const std::string& source) {
  if (!std::holds_alternative<CurvilinearArray>(geometry.array))
    throw InputError(source, "a motorised probe has a linear array, must be curvilinear");
  require_positive(source, "motor_radius_mm", sweep.motor_radius_mm);
  require_monotonic(sweep.frame_angles_rad, source, "frame_angles_rad");
  if (!std::isfinite(sweep.frame_travel_rad))
    throw InputError(source, "'frame_travel_rad' is not finite");
  require_within_right_angle(sweep.frame_angles_rad, 0.5 * std::abs(sweep.frame_travel_rad), source,
                             "frame_angles_rad");
  // Behind the motor axis two motor angles reach the same point and eqs 4.11-4.14 have no inverse.
  const auto& curved = std::get<CurvilinearArray>(geometry.array);
  const double radius = curved.probe_radius_mm;
  for (const double angle : {curved.line_angles_rad.front(), curved.line_angles_rad.back()}) {
    const double H = (radius + geometry.axial.start_depth_mm) * std::cos(angle);
    if (H <= radius - sweep.motor_radius_mm)
      throw InputError(source, "'motor_radius_mm' is " + std::to_string(sweep.motor_radius_mm) +
                                   ", must be > " + std::to_string(radius - H) +
                                   ": else the line at " + in_degrees(angle) +
                                   " starts behind the motor axis");
  }
}

void validate_tracked(const TrackedSweep& sweep, const std::string& source) {
  if (sweep.T_us_frame.empty()) throw InputError(source, "has no frames, must have at least 1");
  for (std::size_t i = 0; i < sweep.T_us_frame.size(); ++i) {
    const Eigen::Isometry3d& T = sweep.T_us_frame[i];
    if (!T.translation().allFinite() || !(deviation_from_rotation(T.linear()) <= kPoseTolerance))
      throw InputError(source, "'frame_poses_mm' of frame " + std::to_string(i) +
                                   " is not a rotation and a finite translation");
  }
  require_frame_times(sweep.frame_times_s, sweep.T_us_frame.size(), source, "frame_times_s");
}

/// Motor angle at a line minus the motor angle at the middle of its frame.
double travel_at_line(double frame_travel_rad, int lines, double line) {
  return frame_travel_rad * ((line + 0.5) / lines - 0.5);
}

const CurvilinearArray& require_curvilinear(const ScanGeometry& geometry) {
  geometry.validate("geometry");
  if (!geometry.is_motorised()) throw InputError("geometry", "is not motorised");
  return std::get<CurvilinearArray>(geometry.array);
}

}  // namespace

void require_frame_times(const std::vector<double>& times_s, std::size_t frames,
                         const std::string& source, const std::string& field) {
  if (times_s.empty()) return;
  if (times_s.size() != frames)
    throw InputError(source, "'" + field + "' has " + std::to_string(times_s.size()) +
                                 " entries for " + std::to_string(frames) +
                                 " frames, must have one per frame");
  for (std::size_t i = 0; i < times_s.size(); ++i)
    if (!std::isfinite(times_s[i]) || (i > 0 && times_s[i] < times_s[i - 1]))
      throw InputError(source, "'" + field + "' entry " + std::to_string(i) + " is " +
                                   std::to_string(times_s[i]) + ", must be finite and not falling");
}

const std::vector<double>& line_table(const Array& array) {
  if (const auto* linear = std::get_if<LinearArray>(&array)) return linear->line_positions_mm;
  return std::get<CurvilinearArray>(array).line_angles_rad;
}

int line_count(const Array& array) { return static_cast<int>(line_table(array).size()); }

int ScanGeometry::lines() const { return line_count(array); }

int ScanGeometry::frames() const {
  if (const auto* sweep = std::get_if<MotorSweep>(&motion))
    return static_cast<int>(sweep->frame_angles_rad.size());
  return static_cast<int>(std::get<TrackedSweep>(motion).T_us_frame.size());
}

void ScanGeometry::validate(const std::string& source) const {
  validate_axial(axial, source);
  validate_array(array, source);
  if (const auto* sweep = std::get_if<MotorSweep>(&motion))
    validate_motor(*sweep, *this, source);
  else
    validate_tracked(std::get<TrackedSweep>(motion), source);
}

Line line_in_frame(const Array& array, double line) {
  const double position = interpolate_table(line_table(array), line);
  if (std::holds_alternative<LinearArray>(array))
    return {Eigen::Vector3d(position, 0.0, 0.0), Eigen::Vector3d::UnitY()};
  const Eigen::Vector3d direction(std::sin(position), std::cos(position), 0.0);
  return {std::get<CurvilinearArray>(array).probe_radius_mm * direction, direction};
}

double motor_angle_rad(const MotorSweep& sweep, int lines, double frame, double line) {
  return interpolate_table(sweep.frame_angles_rad, frame) +
         travel_at_line(sweep.frame_travel_rad, lines, line);
}

Eigen::Isometry3d T_us_frame_at_motor_angle(double probe_radius_mm, double motor_radius_mm,
                                            double motor_angle_rad) {
  // Eqs 4.13 and 4.14, y = (H - D) cos phi + D and z = (H - D) sin phi, are a rotation about the
  // axis through (0, D, 0) parallel to x.
  const Eigen::Translation3d axis(0.0, probe_radius_mm - motor_radius_mm, 0.0);
  return axis * Eigen::AngleAxisd(motor_angle_rad, Eigen::Vector3d::UnitX()) * axis.inverse();
}

Eigen::Isometry3d T_us_frame_of(const ScanGeometry& geometry, int frame, double line) {
  if (const auto* sweep = std::get_if<MotorSweep>(&geometry.motion))
    return T_us_frame_at_motor_angle(std::get<CurvilinearArray>(geometry.array).probe_radius_mm,
                                     sweep->motor_radius_mm,
                                     motor_angle_rad(*sweep, geometry.lines(), frame, line));
  return std::get<TrackedSweep>(geometry.motion).T_us_frame[static_cast<std::size_t>(frame)];
}

Eigen::Vector3d us_from_scan(const ScanGeometry& geometry, const ScanIndex& index) {
  const Line line = line_in_frame(geometry.array, index.line);
  const Eigen::Vector3d p_frame =
      line.origin_mm + geometry.axial.depth_mm(index.sample) * line.direction;
  if (const auto* sweep = std::get_if<MotorSweep>(&geometry.motion)) {
    const double phi = motor_angle_rad(*sweep, geometry.lines(), index.frame, index.line);
    const double radius = std::get<CurvilinearArray>(geometry.array).probe_radius_mm;
    return T_us_frame_at_motor_angle(radius, sweep->motor_radius_mm, phi) * p_frame;
  }
  const auto& poses = std::get<TrackedSweep>(geometry.motion).T_us_frame;
  if (!(index.frame >= 0.0 && index.frame < static_cast<double>(poses.size())) ||
      std::floor(index.frame) != index.frame)
    throw InputError("tracked sweep", "frame index is " + std::to_string(index.frame) +
                                          ", must be a whole number below " +
                                          std::to_string(poses.size()));
  return poses[static_cast<std::size_t>(index.frame)] * p_frame;
}

MotorisedInverse::MotorisedInverse(const ScanGeometry& geometry)
    : axial_(geometry.axial),
      probe_radius_mm_(require_curvilinear(geometry).probe_radius_mm),
      axis_offset_mm_(probe_radius_mm_ - std::get<MotorSweep>(geometry.motion).motor_radius_mm),
      frame_travel_rad_(std::get<MotorSweep>(geometry.motion).frame_travel_rad),
      lines_(geometry.lines()),
      line_angles_(line_table(geometry.array), "geometry", "line_angles_rad"),
      frame_angles_(std::get<MotorSweep>(geometry.motion).frame_angles_rad, "geometry",
                    "frame_angles_rad") {}

ScanIndex MotorisedInverse::scan_from_us(const Eigen::Vector3d& p_us_mm) const {
  return scan_from_swing(swing_from_us(p_us_mm.y(), p_us_mm.z()), p_us_mm.x());
}

MotorisedInverse::Swing MotorisedInverse::swing_from_us(double y_us_mm, double z_us_mm) const {
  const double y_from_axis = y_us_mm - axis_offset_mm_;
  Swing swing;
  swing.phi_rad = std::atan2(z_us_mm, y_from_axis);
  swing.H_mm = axis_offset_mm_ + std::sqrt(y_from_axis * y_from_axis + z_us_mm * z_us_mm);
  if (frame_travel_rad_ == 0.0) swing.frame = frame_angles_.index_of(swing.phi_rad);
  return swing;
}

ScanIndex MotorisedInverse::scan_from_swing(const Swing& swing, double x_us_mm) const {
  const double h = std::sqrt(x_us_mm * x_us_mm + swing.H_mm * swing.H_mm);
  ScanIndex index;
  index.sample = (h - probe_radius_mm_ - axial_.start_depth_mm) / axial_.spacing_mm;
  index.line = line_angles_.index_of(std::atan2(x_us_mm, swing.H_mm));
  index.frame = frame_travel_rad_ == 0.0
                    ? swing.frame
                    : frame_angles_.index_of(swing.phi_rad -
                                             travel_at_line(frame_travel_rad_, lines_, index.line));
  return index;
}

ArrayInverse::ArrayInverse(const Array& array, const AxialSampling& axial)
    : axial_(axial),
      curvilinear_(std::holds_alternative<CurvilinearArray>(array)),
      probe_radius_mm_(curvilinear_ ? std::get<CurvilinearArray>(array).probe_radius_mm : 0.0),
      lines_(line_table(array), "array", curvilinear_ ? "line_angles_rad" : "line_positions_mm") {}

ScanIndex ArrayInverse::scan_from_frame(const Eigen::Vector3d& p_frame_mm) const {
  const double x = p_frame_mm.x();
  const double y = p_frame_mm.y();
  ScanIndex index;
  index.line = lines_.index_of(curvilinear_ ? std::atan2(x, y) : x);
  const double depth = curvilinear_ ? std::hypot(x, y) - probe_radius_mm_ : y;
  index.sample = (depth - axial_.start_depth_mm) / axial_.spacing_mm;
  return index;
}

}  // namespace usct
