#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

/// Detection of steel balls, the fiducials of phantoms (thesis 3.1.1, 3.1.4), in CT and in
/// ultrasound.
namespace usct {

struct DetectedBall {
  /// Centre of the ball, in the frame of the image, mm.
  Eigen::Vector3d centre_mm;
  /// The ball's contrast: in CT the mean HU above the surroundings within a ball of the
  /// given diameter, in ultrasound the grey values above the brightest surroundings at its depth.
  double contrast;
};

/// Something that could be a ball, and why its centre cannot be trusted.
struct RefusedBall {
  Eigen::Vector3d centre_mm;
  std::string reason;
};

struct BallDetection {
  /// Highest contrast first.
  std::vector<DetectedBall> balls;
  std::vector<RefusedBall> refused;
};

struct CtBallOptions {
  double diameter_mm = 1.0;
  /// Mean HU above the surroundings within the ball's diameter that make it metal. Steel has 3000
  /// HU and more, contrasted vessels have up to 500, cortical bone and stones up to 1500.
  double least_contrast_hu = 1500.0;

  /// Throws InputError naming the option: the diameter must be within [0.3, 10] mm, the contrast
  /// within [100, 30000] HU.
  void validate() const;
};

/// Finds balls as bright components of the ball's size, and takes the centroid of the HU above the
/// surroundings, which partial volumes, blur and saturation at the largest HU leave in place, since
/// they are symmetric about the centre. Balls that touch are separated if their blurred images have
/// two maxima, and then only those parts count that the neighbour does not reach.
///
/// Refused are balls that the border cuts, and objects that are as bright but longer than a ball,
/// or hold more than 1.6 or less than 0.6 times the metal of the others.
///
/// Throws InputError if the options are out of range, the volume is invalid, or a voxel is longer
/// than 1.5 times the diameter.
BallDetection detect_balls(const CtVolume& ct, const CtBallOptions& options);

struct UsBallOptions {
  double diameter_mm = 1.0;
  /// Least grey value of the echo's maximum above the surroundings; [1, 255].
  double least_contrast = 80.0;
  /// Distance beyond which the surroundings begin, mm; wider than the echo, and narrower than the
  /// distance of neighbouring balls; [1, 50].
  double echo_radius_mm = 7.0;

  /// Throws InputError naming the option.
  void validate() const;
};

/// Finds balls as compact bright echoes whose surroundings at the same depth are dark. Sound
/// returns from the top of a ball, that is from its point nearest to the array along the beam; the
/// centre is half the diameter behind the echo's maximum along that beam.
///
/// Bubbles and specular points look alike: fiducial_matching.h tells which echoes belong to the
/// balls of the CT. Echoes at the first or last line, frame or sample are refused, since half of
/// them may be missing. Throws InputError if the options are out of range or the volume is invalid.
BallDetection detect_balls(const PreScanVolume& ultrasound, const UsBallOptions& options);

}  // namespace usct
