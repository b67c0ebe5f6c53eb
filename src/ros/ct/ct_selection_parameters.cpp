#include "ros/ct/ct_selection_parameters.h"

#include <vector>

#include "ros/conversions/poses.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {

CtSelection read_selection(Parameters& parameters, const ::ros::NodeHandle& private_node) {
  CtSelection selection;
  const std::vector<double> roi_m = parameters.numbers("roi", 6);
  if (!roi_m.empty()) {
    const Eigen::Map<const Eigen::Vector3d> first(roi_m.data());
    const Eigen::Map<const Eigen::Vector3d> second(roi_m.data() + 3);
    selection.box_mm = box_of(kMmPerM * first, kMmPerM * second);
  }
  selection.decimation = parameters.whole("decimation", 1, 1, CtSelection::kMostDecimation);
  try {
    selection.validate();
  } catch (const InputError& error) {
    throw InputError(private_node.resolveName("roi"), error.violation());
  }
  return selection;
}

void set_selection(const CtSelection& selection, const ::ros::NodeHandle& private_node) {
  private_node.setParam("decimation", selection.decimation);
  if (!selection.box_mm) {
    private_node.deleteParam("roi");
    return;
  }
  const Eigen::Vector3d first = selection.box_mm->min() / kMmPerM;
  const Eigen::Vector3d second = selection.box_mm->max() / kMmPerM;
  private_node.setParam("roi", std::vector<double>{first.x(), first.y(), first.z(), second.x(),
                                                   second.y(), second.z()});
}

Eigen::AlignedBox3d box_of(const Eigen::Vector3d& a_mm, const Eigen::Vector3d& b_mm) {
  const bool is_finite = a_mm.allFinite() && b_mm.allFinite();
  return {is_finite ? Eigen::Vector3d(a_mm.cwiseMin(b_mm)) : a_mm,
          is_finite ? Eigen::Vector3d(a_mm.cwiseMax(b_mm)) : b_mm};
}

}  // namespace usct::ros_interface
