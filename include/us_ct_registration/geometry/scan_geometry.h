#pragma once

#include <Eigen/Geometry>
#include <string>
#include <variant>
#include <vector>

#include "us_ct_registration/geometry/monotonic_table.h"

/// Positions of the samples of a pre-scan ultrasound acquisition (docs/probe_geometry.md).
///
/// Coordinates, all in millimetres:
/// - *frame coordinates* of one 2D frame: origin at the centre of curvature of the array (on the
///   array, at lateral position 0, if it is linear), x lateral, y axial (away from the probe), z
///   elevation;
/// - the *US frame*: for a motorised probe the frame coordinates at zero motor angle; for a tracked
///   probe the frame to which its poses map.
namespace usct {

/// Sampling along every line: sample i lies at depth `start_depth_mm + i * spacing_mm`, measured
/// along the line from the surface of the array.
struct AxialSampling {
  int samples = 0;
  double start_depth_mm = 0.0;
  double spacing_mm = 0.0;

  double depth_mm(double sample) const { return start_depth_mm + sample * spacing_mm; }
};

/// A convex array: lines fan out from the centre of curvature. An angle is measured from the axial
/// direction, positive towards +x (lateral).
struct CurvilinearArray {
  double probe_radius_mm = 0.0;
  std::vector<double> line_angles_rad;
};

/// A flat array: lines are parallel to the axial direction, at these lateral positions.
struct LinearArray {
  std::vector<double> line_positions_mm;
};

using Array = std::variant<CurvilinearArray, LinearArray>;

int line_count(const Array& array);

/// The angles of the lines in radians, or their positions in mm.
const std::vector<double>& line_table(const Array& array);

/// A motor swings a curvilinear array about an axis parallel to x. The surface of the array is at a
/// distance of `motor_radius_mm` from that axis (thesis figure 4.6), so the axis passes through (0,
/// D, 0) with D = probe_radius - motor_radius.
struct MotorSweep {
  double motor_radius_mm = 0.0;
  /// Motor angle phi per frame, at the middle of the frame; never assumed uniform. Positive turns
  /// the axial direction towards +z (elevation).
  std::vector<double> frame_angles_rad;
  /// Motor travel while one frame is acquired, from its first line to its last; 0 if the motor
  /// stops for each frame, negative if it runs towards smaller angles, as in every other sweep.
  double frame_travel_rad = 0.0;
};

/// A sweep of a tracked probe (freehand, or held by a robot): each frame has a pose of its own.
struct TrackedSweep {
  /// Maps frame coordinates to the US frame.
  std::vector<Eigen::Isometry3d> T_us_frame;
  /// Acquisition time per frame in seconds; empty if unknown, else one per frame.
  std::vector<double> frame_times_s;
};

/// A continuous position in a pre-scan volume; whole numbers are the recorded samples.
struct ScanIndex {
  double sample = 0.0;
  double line = 0.0;
  double frame = 0.0;
};

/// The geometry of a pre-scan volume of samples x lines x frames.
struct ScanGeometry {
  AxialSampling axial;
  Array array;
  std::variant<MotorSweep, TrackedSweep> motion;

  int samples() const { return axial.samples; }
  int lines() const;
  int frames() const;
  bool is_motorised() const { return std::holds_alternative<MotorSweep>(motion); }

  /// Throws InputError, naming `source`, the field, its value and the constraint, unless: samples,
  /// lines >= 2, frames >= 1 (>= 2 if motorised); spacing and radii finite and > 0; start depth
  /// finite and >= 0; tables finite and strictly monotonic, line angles, and frame angles with
  /// half the travel of a frame, within +-90 degrees; poses rigid; times one per frame, finite and
  /// not falling; a motorised array curvilinear, and all its lines starting in front of the motor
  /// axis (no point lies on two frames).
  void validate(const std::string& source) const;
};

/// Origin and direction of a line of an array, in frame coordinates.
struct Line {
  Eigen::Vector3d origin_mm;
  Eigen::Vector3d direction;
};

/// The line at a continuous index. It starts at the surface of the array and lies in the plane z =
/// 0.
Line line_in_frame(const Array& array, double line);

/// Motor angle in radians at a continuous frame and line, including the travel within the frame.
double motor_angle_rad(const MotorSweep& sweep, int lines, double frame, double line);

/// Pose of the frame's plane for a motor angle: a rotation about the motor axis.
Eigen::Isometry3d T_us_frame_at_motor_angle(double probe_radius_mm, double motor_radius_mm,
                                            double motor_angle_rad);

/// Pose of the frame at the moment when `line` was acquired, by the motor angle or by tracking.
Eigen::Isometry3d T_us_frame_of(const ScanGeometry& geometry, int frame, double line);

/// Position of a sample in the US frame, by eqs 4.11-4.14 of the thesis for a motorised probe. A
/// tracked sweep has positions at whole frames only; other frame indices throw InputError.
Eigen::Vector3d us_from_scan(const ScanGeometry& geometry, const ScanIndex& index);

/// The inverse of eqs 4.11-4.14 for one motorised geometry. It keeps the tables that it inverts.
///
/// Every point has an index, and `us_from_scan` maps that index back to the point, even where it
/// lies outside the recorded samples. Conversely an index is recovered from its point if the point
/// lies in front of the motor axis (H > D), as everything does that a valid geometry records.
class MotorisedInverse {
 public:
  /// Throws InputError if the geometry is not a valid motorised one.
  explicit MotorisedInverse(const ScanGeometry& geometry);

  ScanIndex scan_from_us(const Eigen::Vector3d& p_us_mm) const;

  /// The part of the inverse that depends on y and z only (eqs 4.13 and 4.14), so that a row of
  /// voxels along x computes it once.
  struct Swing {
    double phi_rad = 0.0;  // motor angle when the frame's plane meets the point
    double H_mm = 0.0;     // the point's axial coordinate in that frame
    double frame = 0.0;  // index of that frame if the motor stops; with travel it depends on x too
  };
  Swing swing_from_us(double y_us_mm, double z_us_mm) const;
  ScanIndex scan_from_swing(const Swing& swing, double x_us_mm) const;

 private:
  AxialSampling axial_;
  double probe_radius_mm_;
  double axis_offset_mm_;  // D
  double frame_travel_rad_;
  int lines_;
  MonotonicTable line_angles_;
  MonotonicTable frame_angles_;
};

/// The inverse of `line_in_frame` for one array: sample and line of a point in the plane of a
/// frame. The z coordinate of the point is ignored, and `frame` of the result is 0.
class ArrayInverse {
 public:
  ArrayInverse(const Array& array, const AxialSampling& axial);

  ScanIndex scan_from_frame(const Eigen::Vector3d& p_frame_mm) const;

 private:
  AxialSampling axial_;
  bool curvilinear_;
  double probe_radius_mm_;
  MonotonicTable lines_;
};

}  // namespace usct
