#pragma once

#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/RegistrationResult.h>
#include <us_ct_registration/StatusCode.h>

#include <Eigen/Geometry>
#include <optional>

#include "us_ct_registration/registration/alignment_decisions.h"

namespace usct::ros_interface {

/// A result as it is offered. Whether its pose is rigid is for AlignmentDecisions to judge. The
/// digest ignores the header's `seq`, which counts what was sent and not what was found.
OfferedResult from_message(const us_ct_registration::RegistrationResult& message);

us_ct_registration::Alignment to_message(const AlignmentState& state);
us_ct_registration::StatusCode to_message(const DecisionAnswer& answer);
geometry_msgs::Transform to_message(const MetricPose& pose);

/// Where the CT lies in the alignment's fixed frame, mm; empty if nothing is broadcast. Throws
/// InputError if the transform is not rigid.
std::optional<Eigen::Isometry3d> T_fixed_ct_from(const us_ct_registration::Alignment& message);

}  // namespace usct::ros_interface
