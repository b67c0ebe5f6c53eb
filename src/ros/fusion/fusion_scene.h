#pragma once

#include <ros/time.h>
#include <std_msgs/Header.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/RegistrationResult.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "ros/alignment/alignment_watch.h"
#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/rendering/fusion_view.h"

namespace usct::ros_interface {

/// The names of all modes, and the mode of a name.
std::set<std::string> fusion_mode_names();
std::optional<FusionMode> fusion_mode_named(const std::string& name);

struct FusionUltrasound {
  std_msgs::Header header;
  PreScanVolume volume;
  std::string fixed_frame;
  /// Pose of the ultrasound's frame in the fixed frame at the stamp, mm; unset if tf does not know.
  std::optional<Eigen::Isometry3d> T_fixed_us;
  /// A shortcoming of what is drawn, in words; empty if there is none.
  std::string warning;
};

struct FusionCt {
  CtVolume volume;
  std::uint32_t crc32 = 0;
};

/// A point in a frame, mm.
struct FramedPoint {
  std::string frame;
  Eigen::Vector3d p_mm;
};

/// One view to draw. It shares the images with the keeper.
struct FusionScene {
  /// Null: there is nothing to draw.
  std::shared_ptr<const FusionUltrasound> us;
  std::shared_ptr<const FusionCt> ct;
  FusionPose pose;
  FusionMode mode = FusionMode::kContours;
  /// Points in which the planes may meet, US frame, mm; the first one within the ultrasound counts.
  std::vector<Eigen::Vector3d> centres_us_mm;
};

struct FusionSceneOptions {
  FusionMode mode = FusionMode::kContours;
  /// The point in which the planes meet unless somebody sets another, US frame, mm.
  std::optional<Eigen::Vector3d> centre_us_mm;
  /// Else the planes meet in the middle of the surface whose name contains this, if there is one.
  std::string centre_label = "kidney";
  /// Full names of the services that decide, for people.
  std::string accept_service = "registration/accept";
  std::string reject_service = "registration/reject";
};

/// Keeps the newest images and decisions, and says what may be drawn: a pose only on the ultrasound
/// and with the CT that were registered, by stamp and checksum, and an accepted one only while tf
/// has it. Not synchronised.
class FusionSceneKeeper {
 public:
  explicit FusionSceneKeeper(FusionSceneOptions options);

  void take(std::shared_ptr<const FusionUltrasound> us) { us_ = std::move(us); }
  void take(std::shared_ptr<const FusionCt> ct) { ct_ = std::move(ct); }
  void take_alignment(const us_ct_registration::Alignment& message);
  void take_proposed(const us_ct_registration::Alignment& message) { proposed_ = message; }
  /// Looks the accepted alignment up in tf. Returns whether it may change the scene.
  bool look_up(const TfBuffer& tf, const ::ros::Time& now,
               AlignmentWatch::Clock::time_point wall_now) {
    return alignment_watch_.look_up(tf, now, wall_now);
  }
  /// Why the accepted alignment is not in force; empty if it is, or if there is none.
  const std::string& alignment_problem() const { return alignment_watch_.problem(); }
  /// Throws InputError, naming the topic, as `registration_result_from`.
  void take_result(const us_ct_registration::RegistrationResult& message);
  /// Throws InputError, naming the topic, if a marker's pose is not rigid.
  void take_surface(const visualization_msgs::MarkerArray& message);
  void set_mode(FusionMode mode) { mode_ = mode; }
  /// Sets or, with nothing, forgets the point in which the planes meet.
  void set_centre(const std::optional<FramedPoint>& centre) { centre_ = centre; }

  FusionScene scene() const;
  /// Whether the pose of the scene still stands as it did, for the images of the scene.
  bool is_current(const FusionScene& scene) const;

 private:
  /// A result, and the images of which it is.
  struct Known {
    std_msgs::Header us;
    std::uint32_t ct_crc32 = 0;
    std::uint64_t id = 0;
    RegistrationResult result;
  };
  /// A pose, or the reason in words why it cannot be drawn.
  struct Attempt {
    std::optional<Eigen::Isometry3d> T_us_ct;
    std::string why_not;
  };

  const Known* known(std::uint64_t id) const;
  Attempt pose_by(const us_ct_registration::Alignment& message, const FusionUltrasound& us,
                  const FusionCt& ct) const;
  FusionPose pose_of(const FusionUltrasound& us, const FusionCt* ct) const;
  /// The best candidate of the last registration, if that was refused and is of these images.
  std::optional<FusionPose> refused_pose(const FusionUltrasound& us, const FusionCt& ct) const;
  std::string evidence(const us_ct_registration::Alignment& message) const;
  std::vector<Eigen::Vector3d> centres_us_mm(const FusionPose& pose) const;

  const FusionSceneOptions options_;
  std::shared_ptr<const FusionUltrasound> us_;
  std::shared_ptr<const FusionCt> ct_;
  us_ct_registration::Alignment alignment_;
  AlignmentWatch alignment_watch_;
  us_ct_registration::Alignment proposed_;
  std::map<std::uint64_t, Known> results_;
  std::optional<Known> last_;
  std::vector<Eigen::Vector3d> label_middles_ct_mm_;
  FusionMode mode_;
  std::optional<FramedPoint> centre_;
};

}  // namespace usct::ros_interface
