#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/SetInitialAlignment.h>

#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "ros/fixed_frame.h"
#include "ros/held_volumes.h"

namespace usct::ros_interface {

/// A pose of the CT in a frame that tf connects to the ultrasound's.
struct FramedAlignment {
  std::string frame;
  Eigen::Isometry3d T_frame_ct = Eigen::Isometry3d::Identity();
};

/// Where a registration starts.
struct InitialAlignment {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  /// As in RegistrationResult.
  std::string source;
};

/// What is known of where the CT lies, before a registration: the first that exists counts. May be
/// called from any thread.
class InitialAlignments {
 public:
  InitialAlignments(const FixedFrame& frame, std::optional<FramedAlignment> from_parameters);

  /// Anchors it in the fixed frame as of the newest ultrasound, which `newest` gives (or refuses);
  /// it is asked only where the frame needs it. Returns what is left between landmarks, m.
  /// Refuses with INVALID_REQUEST or TF_UNAVAILABLE; then all stays as it was.
  double set(const us_ct_registration::SetInitialAlignment::Request& request, ::ros::Time now,
             const std::function<std::shared_ptr<const HeldUltrasound>()>& newest);

  void arrived(const us_ct_registration::Alignment::ConstPtr& message);

  /// Refuses with TF_UNAVAILABLE, INVALID_REQUEST (`of_goal`) or INVALID_MESSAGE. Empty: there is
  /// none.
  std::optional<InitialAlignment> choose(
      const std::optional<geometry_msgs::TransformStamped>& of_goal, const HeldUltrasound& us,
      const std::string& ct_frame) const;

 private:
  std::optional<InitialAlignment> accepted(const HeldUltrasound& us,
                                           const std::string& ct_frame) const;
  InitialAlignment in_ultrasound(const FramedAlignment& alignment, const HeldUltrasound& us,
                                 const std::string& source) const;

  const FixedFrame& frame_;
  const std::optional<FramedAlignment> from_parameters_;

  mutable std::mutex mutex_;
  std::optional<FramedAlignment> set_;
  ::ros::Time set_at_;
  us_ct_registration::Alignment::ConstPtr accepted_;
};

}  // namespace usct::ros_interface
