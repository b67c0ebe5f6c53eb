#pragma once

#include "us_ct_registration/volume/volume.h"

namespace usct::phantom {

/// Signed distance to the surface of a mask in mm, negative inside: exact Euclidean distances
/// between voxel centres (Felzenszwalb and Huttenlocher 2012), corrected by half a voxel to the
/// surface.
Volume<float> signed_distance(const MaskVolume& mask);

/// The signed distance, smoothed over `sigma_mm`, so that its zero level has no staircase.
Volume<float> smooth_signed_distance(const MaskVolume& mask, double sigma_mm);

}  // namespace usct::phantom
