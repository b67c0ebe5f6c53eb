#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/RegistrationResult.h>
#include <us_ct_registration/StatusCode.h>

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "us_ct_registration/alignment/alignment_decisions.h"
#include "us_ct_registration/registration/registration_result.h"

namespace usct::ros_interface {

/// The result of a message. AlignmentDecisions checks that its pose is rigid. The digest ignores
/// the header's `seq`, which counts messages and is no part of the result. The covariance is that
/// of the message, turned into the fixed frame.
OfferedResult from_message(const us_ct_registration::RegistrationResult& message);

/// The field `policy` is the caller's.
us_ct_registration::Alignment to_message(const AlignmentState& state);

/// The alignment that waits for a person's decision; its state is NONE if none does. The field
/// `policy` is the caller's.
us_ct_registration::Alignment to_proposed_message(const AlignmentState& state);

/// The alignment as messages that other packages know, with the stamp of the ultrasound.
geometry_msgs::TransformStamped to_transform_message(const Alignment& alignment);
/// Empty if the covariance is not known: all zeros would mean that the pose is exact.
std::optional<geometry_msgs::PoseWithCovarianceStamped> to_pose_message(const Alignment& alignment);

us_ct_registration::StatusCode to_message(const DecisionAnswer& answer);
geometry_msgs::Transform to_message(const MetricPose& pose);

/// Pose of the CT in the alignment's fixed frame, mm; empty if nothing is broadcast. Throws
/// InputError if the transform is not rigid.
std::optional<Eigen::Isometry3d> T_fixed_ct_from(const us_ct_registration::Alignment& message);

/// The evidence for an alignment, in lines. `result` is the one with the alignment's number; null:
/// it is not known, and all that is said is the alignment's expected error.
std::string evidence_of(const us_ct_registration::Alignment& alignment,
                        const RegistrationResult* result);

}  // namespace usct::ros_interface
