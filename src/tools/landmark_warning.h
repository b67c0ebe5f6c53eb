#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::tools {

/// Landmarks of one image, mm, and the file that they come from.
struct LandmarkFile {
  std::string path;
  std::vector<Eigen::Vector3d> points_mm;
};

/// Warns on standard error of landmarks that do not fit each other: whose fiducial registration
/// error is larger than 5 mm, which a start or a truth must not be, or that would fit far better in
/// another order, since those that lie close fit to a few mm in any. Warns of landmarks of one
/// image that lie so close that they can only be in metres.
void warn_of_landmarks(const LandmarkFile& ct, const LandmarkFile& us, double fre_mm);

/// Throws InputError, naming file and point, if a landmark does not lie in its image, as if the
/// files are exchanged, in metres or in another frame.
void require_in_images(const LandmarkFile& ct, const LandmarkFile& us, const CtVolume& ct_image,
                       const BeamGrid& beams);

/// Throws that error if the middles of the landmarks lie in the images only with the files
/// exchanged. Else it is a warning: a start may come from landmarks beside a CT that was cropped,
/// which a truth may not.
void warn_of_places(const LandmarkFile& ct, const LandmarkFile& us, const CtVolume& ct_image,
                    const BeamGrid& beams);

/// Warns on standard error of points of the US frame that lie more than 10 mm outside the box of
/// the samples, as those of another frame do, and of points that can only be in metres.
void warn_of_targets(const LandmarkFile& us, const BeamGrid& beams);

}  // namespace usct::tools
