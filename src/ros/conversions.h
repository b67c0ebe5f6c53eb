#pragma once

#include <geometry_msgs/Point.h>
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Transform.h>
#include <us_ct_registration/CtVolume.h>
#include <us_ct_registration/PreScanFrame.h>
#include <us_ct_registration/PreScanVolume.h>
#include <us_ct_registration/ProbeGeometry.h>
#include <us_ct_registration/RegistrationResult.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

/// Between the core (millimetres, radians) and messages (metres, radians): the only place where the
/// two meet.
///
/// What comes from a message is checked before anything is allocated for it: sizes against the data
/// that are there, checksums, numbers, geometry. What is wrong is an InputError that names
/// `source`, the field, its value and the constraint.
namespace usct::ros_interface {

constexpr double kMmPerM = 1000.0;

Eigen::Vector3d point_from_message_mm(const geometry_msgs::Point& point_m);
geometry_msgs::Point to_message(const Eigen::Vector3d& point_mm);

/// The quaternion must have length 1 within 1e-3 (an all-zero one is not a rotation).
Eigen::Isometry3d from_message_mm(const geometry_msgs::Transform& transform_m,
                                  const std::string& source);
Eigen::Isometry3d from_message_mm(const geometry_msgs::Pose& pose_m, const std::string& source);
geometry_msgs::Transform to_message(const Eigen::Isometry3d& T_mm);
geometry_msgs::Pose to_pose_message(const Eigen::Isometry3d& T_mm);

/// The array and the samples along its lines; the motion is not in the message.
us_ct_registration::ProbeGeometry to_probe_message(const ScanGeometry& geometry);
Array array_from_message(const us_ct_registration::ProbeGeometry& message,
                         const std::string& source);
AxialSampling axial_from_message(const us_ct_registration::ProbeGeometry& message, unsigned samples,
                                 const std::string& source);

/// Throws InputError unless a frame's sizes, data and numbers agree.
void validate(const us_ct_registration::PreScanFrame& message, const std::string& source);

/// `crc32` of a volume's `data`.
std::uint32_t data_checksum(const std::vector<std::uint8_t>& data);

us_ct_registration::PreScanVolume to_message(const PreScanVolume& volume,
                                             const std_msgs::Header& header);
PreScanVolume from_message(const us_ct_registration::PreScanVolume& message,
                           const std::string& source);

us_ct_registration::CtVolume to_message(const CtVolume& ct, const std_msgs::Header& header,
                                        unsigned revision);
CtVolume from_message(const us_ct_registration::CtVolume& message, const std::string& source);

/// Fills what the core knows: status, transform, covariance, candidates, measures, durations...;
/// frames, stamps, ids and the fixed frame are the node's.
us_ct_registration::RegistrationResult to_message(const RegistrationResult& result);

}  // namespace usct::ros_interface
