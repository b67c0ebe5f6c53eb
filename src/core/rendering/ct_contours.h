#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "us_ct_registration/rendering/registration_pictures.h"

namespace usct::rendering {

/// Draws the iso-lines of the CT that lie in `plane` (US frame).
void draw_contours(Picture& picture, const CtVolume& ct, const Eigen::Isometry3d& T_us_ct,
                   const SlicePlane& plane, const RegistrationPictureOptions& options);

/// The levels to draw if RegistrationPictureOptions::levels is empty, from the CT in the planes
/// within the mask.
std::vector<ContourLevel> choose_levels(const CtVolume& ct, const Eigen::Isometry3d& T_us_ct,
                                        const MaskVolume& mask,
                                        const std::array<SlicePlane, 3>& planes,
                                        double smoothing_mm);

}  // namespace usct::rendering
