#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/CtInfo.h>
#include <us_ct_registration/RegistrationResult.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/rendering/overlay.h"

namespace usct::ros_interface {

/// The parameters of a structure; its surface, name and colour come from `ct/surface`.
struct StructureStyle {
  bool is_visible = true;
  bool has_band = false;
  std::optional<Picture::Colour> colour;
  double opacity = 0.25;
};

struct OverlaySceneOptions {
  /// By name, without the number of the label.
  std::map<std::string, StructureStyle> styles;
  /// The bound of the registration's error in 90 of 100 right registrations, over its expected
  /// error (docs/confidence.md).
  double bound_factor = ErrorOptions().bound_factor;
  /// The alignment is called old if its ultrasound was acquired longer before the image, s.
  double old_after_s = 1800.0;
};

/// The structures to draw into one image, at the places that the alignment gives them.
struct OverlayScene {
  /// The reason why nothing may be drawn, in words; the fields up to `bound_mm` count only if it is
  /// empty.
  std::string refusal;
  std::string fixed_frame;
  std::string ct_frame;
  Eigen::Isometry3d T_fixed_ct = Eigen::Isometry3d::Identity();
  std::uint64_t result_id = 0;
  std::uint32_t ct_crc32 = 0;
  /// The visible structures; those with a band have `bound_mm` of the registration alone.
  std::vector<OverlayStructure> structures;
  /// The error bound of the registration, at the structure with a band for which it is largest, mm.
  std::optional<double> bound_mm;
  /// The age of the ultrasound that was registered, at the image, s.
  double age_s = 0.0;
  /// Warnings about the alignment for the person who looks at the image, one line each.
  std::vector<std::string> warnings;
};

/// Keeps the newest surfaces and the newest decisions about the alignment, and says what may be
/// drawn. May be called from any thread.
class OverlaySceneKeeper {
 public:
  explicit OverlaySceneKeeper(OverlaySceneOptions options) : options_(std::move(options)) {}

  /// Throws InputError, naming the topic, if a surface is not a list of finite triangles; there are
  /// no surfaces then.
  void take_surface(const visualization_msgs::MarkerArray& message);
  void take_info(const us_ct_registration::CtInfo& message);
  void take_alignment(const us_ct_registration::Alignment& message);
  void take_pose(const geometry_msgs::PoseWithCovarianceStamped& message);
  void take_result(const us_ct_registration::RegistrationResult& message);

  /// The scene to draw into an image with this stamp, s since 1970.
  OverlayScene at(const ::ros::Time& stamp) const;
  /// Whether the alignment is still that of the scene, and the surfaces are of its CT.
  bool is_current(const OverlayScene& scene) const;
  /// Names of structures in the parameters that `ct/surface` does not have, and those that it has,
  /// in words; empty if there are none.
  std::string misnamed() const;

 private:
  struct Structure {
    std::shared_ptr<const Surface> surface;
    std::string name;
    Picture::Colour colour;
    std::string frame;
  };
  struct Surfaces {
    std::vector<Structure> structures;
    /// The checksum of their CT, if they say it.
    std::optional<std::uint32_t> ct_crc32;
  };

  static Surfaces surfaces_from(const visualization_msgs::MarkerArray& message);
  std::string why_not() const;
  std::vector<std::string> warnings_at(double age_s) const;
  /// A structure for which a band is wished, if none of those has arrived; else empty.
  std::string missing_band() const;
  /// The error bound of the registration at the surface, mm; unset: it is not known.
  std::optional<double> bound_mm(const Surface& surface, const Eigen::Isometry3d& T_fixed_ct) const;

  const OverlaySceneOptions options_;
  mutable std::mutex mutex_;
  std::optional<Surfaces> surfaces_;
  std::optional<std::uint32_t> ct_crc32_;
  std::optional<us_ct_registration::Alignment> alignment_;
  std::optional<geometry_msgs::PoseWithCovarianceStamped> pose_;
  std::string last_refusal_;
};

}  // namespace usct::ros_interface
