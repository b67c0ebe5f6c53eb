#pragma once

#include <ros/node_handle.h>

#include <Eigen/Geometry>

#include "ros/node/parameters.h"
#include "us_ct_registration/io/volumes/ct_selection.h"

namespace usct::ros_interface {

/// The part of a CT that the parameters `roi` and `decimation` of a node choose. Throws InputError,
/// naming the parameter, if they are not valid.
CtSelection read_selection(Parameters& parameters, const ::ros::NodeHandle& private_node);

/// Writes the part into these parameters.
void set_selection(const CtSelection& selection, const ::ros::NodeHandle& private_node);

/// The box with these corners, mm. NaN, which a box of Eigen would drop, is kept.
Eigen::AlignedBox3d box_of(const Eigen::Vector3d& a_mm, const Eigen::Vector3d& b_mm);

}  // namespace usct::ros_interface
