#pragma once

#include <rapidcheck.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/grid.h"
#include "us_ct_registration/geometry/scan_geometry.h"

/// Random but valid geometry for property tests.
namespace usct::test {

/// An integer in [low, high), from the whole range in every run (rapidcheck starts small).
inline int integer(int low, int high) {
  return *rc::gen::resize(rc::kNominalSize, rc::gen::inRange(low, high));
}

inline double uniform(double low, double high) {
  return low + (high - low) * integer(0, 1000001) / 1e6;
}

/// `count` strictly monotonic values from `low` to `high` or from `high` to `low`; steps differ by
/// a factor of up to ten.
inline std::vector<double> uneven_table(int count, double low, double high) {
  std::vector<double> values{0.0};
  for (int i = 1; i < count; ++i) values.push_back(values.back() + uniform(0.1, 1.0));
  const double scale = (high - low) / values.back();
  const bool falling = *rc::gen::arbitrary<bool>();
  for (double& value : values) value = falling ? high - scale * value : low + scale * value;
  return values;
}

inline AxialSampling random_axial() {
  return {integer(2, 600), uniform(0.0, 10.0), uniform(0.02, 1.0)};
}

inline CurvilinearArray random_curvilinear() {
  const double edge = uniform(0.05, 75.0 * kDegree);
  return {uniform(5.0, 80.0), uneven_table(integer(2, 200), -edge, uniform(0.0, edge))};
}

/// Random motorised sweep: motor radius above or below the probe radius, tables rising or falling,
/// travel of either sign.
inline ScanGeometry random_motorised() {
  ScanGeometry geometry;
  geometry.axial = random_axial();
  const CurvilinearArray array = random_curvilinear();
  const double edge =
      std::max(std::abs(array.line_angles_rad.front()), std::abs(array.line_angles_rad.back()));
  const double H_min = (array.probe_radius_mm + geometry.axial.start_depth_mm) * std::cos(edge);
  const double D = uniform(-array.probe_radius_mm, 0.98 * std::min(H_min, array.probe_radius_mm));
  MotorSweep sweep;
  sweep.motor_radius_mm = array.probe_radius_mm - D;
  sweep.frame_travel_rad = *rc::gen::arbitrary<bool>() ? 0.0 : uniform(-0.1, 0.1);
  sweep.frame_angles_rad =
      uneven_table(integer(2, 120), uniform(-80.0, -1.0) * kDegree, uniform(1.0, 80.0) * kDegree);
  geometry.array = array;
  geometry.motion = sweep;
  return geometry;
}

inline Eigen::Matrix3d random_rotation() {
  const Eigen::Quaterniond q(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(0.1, 1));
  return q.normalized().toRotationMatrix();
}

inline Eigen::Isometry3d random_pose(double reach_mm = 100.0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = random_rotation();
  T.translation() = Eigen::Vector3d(uniform(-reach_mm, reach_mm), uniform(-reach_mm, reach_mm),
                                    uniform(-reach_mm, reach_mm));
  return T;
}

/// A small grid: oblique, anisotropic, possibly left-handed.
inline Grid random_grid(int largest = 12) {
  Grid grid;
  for (int axis = 0; axis < 3; ++axis) {
    grid.size[axis] = integer(2, largest + 1);
    grid.spacing_mm[axis] = uniform(0.2, 3.0);
    grid.origin_mm[axis] = uniform(-50.0, 50.0);
  }
  grid.direction = random_rotation();
  if (*rc::gen::arbitrary<bool>()) grid.direction.col(integer(0, 3)) *= -1.0;
  return grid;
}

}  // namespace usct::test
