#pragma once

#include <Eigen/Core>
#include <vector>

#include "us_ct_registration/geometry/camera.h"

namespace usct::phantom {

/// For the centre of each pixel, row by row, the point at z = 1 of the optical frame that a lens
/// with plumb_bob distortion projects there: the inverse of
/// `x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)` (y alike, with p1 and p2
/// exchanged), by fixed-point iteration. Throws InputError if the iteration does not converge in a
/// corner of the image: the distortion is too strong for it.
std::vector<Eigen::Vector2f> lines_of_sight(const CameraIntrinsics& lens);

}  // namespace usct::phantom
