#pragma once

#include <ros/node_handle.h>

#include <optional>
#include <string>

#include "ros/registration/held_volumes.h"
#include "ros/registration/initial_alignments.h"
#include "ros/registration/registrar.h"
#include "ros/tf/fixed_frame.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {

/// Parameters of the registration node; config/nodes/registration.yaml explains each.
struct RegistrationParameters {
  FixedFrameOptions frame;
  HeldVolumesOptions volumes;
  RegistrarOptions registrar;
  std::optional<FramedAlignment> initial_alignment;
  double tf_history_s = kTfHistory_s;
  double max_tf_gap_s = kMaxTfGap_s;
  int threads = 0;
  bool continuous = false;
  double diagnostic_period_s = 1.0;
  /// Name of the options in messages.
  std::string source;
};

/// Throws InputError, naming the parameter, its value and the constraint.
RegistrationParameters read_registration_parameters(const ::ros::NodeHandle& private_node);

}  // namespace usct::ros_interface
