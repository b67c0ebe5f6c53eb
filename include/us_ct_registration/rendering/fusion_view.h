#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>
#include <utility>

#include "us_ct_registration/rendering/picture.h"
#include "us_ct_registration/rendering/registration_pictures.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"
#include "us_ct_registration/volume/volume.h"

/// Three orthogonal planes of ultrasound with the CT at one pose, for a person who decides on that
/// pose. Each picture says how the pose stands.
namespace usct {

enum class FusionMode {
  kUltrasound,    // nothing of the CT
  kContours,      // iso-lines of the CT on the ultrasound
  kBlend,         // ultrasound blue, CT orange
  kCheckerboard,  // squares of ultrasound and CT in turn
  kSimulated,     // ultrasound simulated from the CT
};

constexpr auto words_of(FusionMode) {
  return std::array<std::pair<FusionMode, const char*>, 5>{
      {{FusionMode::kUltrasound, "ultrasound"},
       {FusionMode::kContours, "contours"},
       {FusionMode::kBlend, "blend"},
       {FusionMode::kCheckerboard, "checkerboard"},
       {FusionMode::kSimulated, "simulated"}}};
}

/// The decision about a pose.
enum class PoseStanding {
  kNone,      // there is no pose to draw
  kAccepted,  // it counts
  kWaiting,   // a person has to decide
  kRefused,   // it is no registration and must not be used
};

struct FusionPose {
  PoseStanding standing = PoseStanding::kNone;
  /// `p_us = T_us_ct * p_ct`, mm; unset if and only if there is no pose to draw.
  std::optional<Eigen::Isometry3d> T_us_ct;
  /// The decision, or the reason why there is no pose, in words.
  std::string headline;
  /// The evidence for and against the pose, in lines.
  std::string evidence;
};

struct FusionViewOptions {
  FusionMode mode = FusionMode::kContours;
  /// Planes, pixels, levels and windows.
  RegistrationPictureOptions pictures;
};

/// The planes are named by the axis of the ultrasound to which they are perpendicular, so that the
/// position along that axis is the same everywhere in the plane.
struct FusionView {
  Picture elevation;  // lateral to the right, axial (depth) down: as the probe's own image
  Picture lateral;    // elevation to the right, axial down
  Picture axial;      // lateral to the right, elevation down
  /// Ultrasound alone above the planes in their mode, the headline above and the evidence below.
  Picture sheet;
};

/// Scan conversion for the view, which closes gaps between frames that are up to 8 mm wide. Throws
/// InputError if the volume or the spacing is invalid.
ScanConverted in_fusion_space(const PreScanVolume& us, double spacing_mm = 0.5);

/// Draws the view. Without a pose the ultrasound is drawn alone, whatever the mode; `ct` and
/// `simulated` are then not used. `simulated` is `simulate_like` in space, and
/// is needed for its mode only. Throws InputError if an option is invalid, the mask is empty, or
/// the mode needs what is null.
FusionView draw_fusion_view(const ScanConverted& us, const CtVolume* ct,
                            const ScanConverted* simulated, const FusionPose& pose,
                            const FusionViewOptions& options);

/// Ultrasound simulated from the CT at a pose (see simulation.h, with its default options), fitted
/// to all samples of `us`, with the same geometry. Throws InputError that says why nothing could be
/// fitted.
PreScanVolume simulate_like(const PreScanVolume& us, const CtVolume& ct,
                            const Eigen::Isometry3d& T_us_ct);

}  // namespace usct
