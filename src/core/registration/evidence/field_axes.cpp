#include "registration/evidence/field_axes.h"

#include <Eigen/Geometry>

namespace usct::registration {

FieldAxes field_axes(const BeamGrid& beams) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Beam& beam : beams.beams) sum += beam.direction;
  const Eigen::Vector3d axial = sum.normalized();
  const double middle = 0.5 * (beams.samples() - 1);
  const int frame = beams.frames / 2;
  const Eigen::Vector3d across =
      beams.point(frame, beams.lines - 1, middle) - beams.point(frame, 0, middle);
  const Eigen::Vector3d lateral_part = across - across.dot(axial) * axial;
  // A single line has no lateral direction of its own; any will do.
  const Eigen::Vector3d lateral =
      lateral_part.norm() > 0.0 ? lateral_part.normalized() : axial.unitOrthogonal();
  return {axial, lateral, axial.cross(lateral)};
}

}  // namespace usct::registration
