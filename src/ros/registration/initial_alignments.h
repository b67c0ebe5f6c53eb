#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/SetInitialAlignment.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "ros/registration/held_volumes.h"
#include "ros/tf/fixed_frame.h"
#include "us_ct_registration/alignment/alignment_decisions.h"

namespace usct::ros_interface {

/// A pose of the CT in a frame that tf connects to the ultrasound's.
struct FramedAlignment {
  std::string frame;
  Eigen::Isometry3d T_frame_ct = Eigen::Isometry3d::Identity();
};

/// The pose from which a registration starts.
struct InitialAlignment {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  /// Source of the pose, as in RegistrationResult.msg.
  std::string source;
};

/// Chooses the pose from which a registration starts: that of the goal, the one that was set, the
/// last accepted one, or that of the parameters; the first that exists counts. One that was set or
/// accepted is that of one CT, and says nothing of another. May be called from any thread.
class InitialAlignments {
 public:
  /// Source of the last accepted alignment.
  static constexpr const char* kAccepted = "accepted";

  InitialAlignments(const FixedFrame& frame, std::optional<FramedAlignment> from_parameters);

  /// Sets an alignment. It is anchored in the fixed frame at the time of the newest ultrasound,
  /// which `newest` returns or refuses; `newest` is called only if the request's frame is not the
  /// fixed one. It is that of `ct`, or, if that is empty, of the CT for which it is chosen first.
  /// It counts until a result is accepted of a registration that began after it was set. Returns
  /// the residual between landmarks, m. Refuses with INVALID_REQUEST or TF_UNAVAILABLE; then
  /// nothing changes.
  double set(const us_ct_registration::SetInitialAlignment::Request& request,
             const std::optional<CtIdentity>& ct,
             const std::function<std::shared_ptr<const HeldUltrasound>()>& newest);

  void arrived(const us_ct_registration::Alignment::ConstPtr& message);
  /// Whether the alignment in force is that of this CT by the ultrasound with this stamp.
  bool is_in_force(const ::ros::Time& us_stamp, const CtIdentity& ct) const;
  /// Policy of tf_publisher; empty until an alignment has arrived.
  std::string policy() const;

  /// Pose of the first source that has one; empty if none has, for a registration that begins at
  /// `now_ms`, a time as in the results' numbers. Refuses with TF_UNAVAILABLE, INVALID_REQUEST
  /// (`of_goal`) or INVALID_MESSAGE.
  std::optional<InitialAlignment> choose(
      const std::optional<geometry_msgs::TransformStamped>& of_goal, const HeldUltrasound& us,
      const HeldCt& ct, std::uint64_t now_ms);

 private:
  /// Whether an alignment is in force that is of this CT. The caller must hold `mutex_`.
  bool has_accepted(const CtIdentity& ct) const;
  std::optional<InitialAlignment> accepted(const HeldUltrasound& us, const HeldCt& ct) const;
  InitialAlignment in_ultrasound(const FramedAlignment& alignment, const HeldUltrasound& us,
                                 const std::string& source) const;

  const FixedFrame& frame_;
  const std::optional<FramedAlignment> from_parameters_;

  mutable std::mutex mutex_;
  std::optional<FramedAlignment> set_;
  std::optional<CtIdentity> set_for_;
  /// When the first registration began after it was set; unset: none has. An accepted result of
  /// one that began before does not end it.
  std::optional<std::uint64_t> used_since_ms_;
  us_ct_registration::Alignment::ConstPtr accepted_;
};

}  // namespace usct::ros_interface
