#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/rendering/picture.h"
#include "us_ct_registration/rendering/slices.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"
#include "us_ct_registration/volume/volume.h"

/// Pictures for people to judge a registration by: iso-lines of the CT, drawn on the ultrasound,
/// must lie on the ultrasound's edges. They are drawn only within the CT.
///
/// A result that was refused is drawn at its best candidate, if it has one, and every such picture
/// says so in red.
namespace usct {

/// An iso-line of the CT.
struct ContourLevel {
  double hu = 0.0;
  std::string name;
  Picture::Colour colour{255, 255, 255};
};

struct RegistrationPictureOptions {
  /// The point in which the three planes meet; the middle of the known ultrasound if unset.
  std::optional<Eigen::Vector3d> centre_us_mm;
  /// Columns are the lateral, axial and elevation axes of the pictures in the US frame, a rotation
  /// (see `picture_axes`).
  Eigen::Matrix3d axes_us = Eigen::Matrix3d::Identity();
  double pixel_mm = 0.4;
  /// If empty, the levels are the border of fat and soft tissue (-30 HU), bone (300 HU), and a
  /// level between them if the CT in the field of the ultrasound has two clear classes there, which
  /// it then separates: the kidney and its surroundings in a CT with contrast medium or in agar.
  std::vector<ContourLevel> levels;
  /// Standard deviation of the Gaussian that smooths the CT in the plane before its lines are
  /// drawn: a lower value leaves noise, a higher one rounds off small structures.
  double smoothing_mm = 1.0;
  /// Connected lines of a total length below this are noise and are not drawn.
  double least_length_mm = 12.0;
  /// The HU window in which the CT itself is drawn.
  CtWindow window;

  /// Throws InputError, naming `source`, if a length is not finite and > 0 (`smoothing_mm` and
  /// `least_length_mm`: >= 0), the centre or a level is not finite, the axes are not a rotation, or
  /// the window does not rise.
  void validate(const std::string& source) const;
};

/// Axes in which a tracked sweep is easiest to look at, for RegistrationPictureOptions::axes_us:
/// those of its middle frame or image. Those of the US frame for any other ultrasound.
Eigen::Matrix3d picture_axes(const Ultrasound& ultrasound);

/// Columns are three orthogonal planes: lateral-axial, elevation-axial, lateral-elevation. Rows are
/// the ultrasound alone, with the CT's lines at the pose before, and at the one after the
/// registration. Throws InputError if an option is invalid or the mask is empty.
Picture picture_registration(const ScanConverted& us, const CtVolume& ct,
                             const Eigen::Isometry3d& T_us_ct_before,
                             const RegistrationResult& result,
                             const RegistrationPictureOptions& options = {});

/// Shows the pose after the registration only. Rows are the three planes; columns ultrasound and
/// CT, both with the CT's lines, and both as a blend and a checkerboard. Throws InputError also if
/// there is no pose to draw.
Picture picture_fusion(const ScanConverted& us, const CtVolume& ct,
                       const RegistrationResult& result,
                       const RegistrationPictureOptions& options = {});

/// Shows the pose after the registration only. Rows are the directions of the three planes; columns
/// parallel planes evenly through the ultrasound's field, with the CT's lines. Throws InputError
/// also if there is no pose to draw.
Picture picture_parallel_slices(const ScanConverted& us, const CtVolume& ct,
                                const RegistrationResult& result,
                                const RegistrationPictureOptions& options = {});

/// Writes the three pictures above as `before_after.png`, `fusion.png` and `slices.png` to
/// `folder`, which is created; the last two only if there is a pose to draw. Returns the paths.
/// Throws InputError as the three functions do, and if a file cannot be written.
std::vector<std::filesystem::path> write_registration_pictures(
    const ScanConverted& us, const CtVolume& ct, const Eigen::Isometry3d& T_us_ct_before,
    const RegistrationResult& result, const std::filesystem::path& folder,
    const RegistrationPictureOptions& options = {});

}  // namespace usct
