#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Triangles in the frame of the volume that they come from (LPS mm for a CT), seen from outside
/// anticlockwise. Closed: where the volume ends inside, its border closes the surface.
struct Surface {
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// The surface of each label that has voxels, by label, from marching cubes. With more than
/// `most_triangles` at full resolution a label is smoothed and sampled more coarsely until it has
/// no more: then what is thinner than the coarser grid is lost. Throws InputError if
/// `most_triangles` is < 1000.
std::map<int, Surface> label_surfaces(const LabelVolume& labels, std::size_t most_triangles);

/// The surface of the voxels of the CT above `hu`, likewise.
Surface iso_surface(const CtVolume& ct, double hu, std::size_t most_triangles);

}  // namespace usct
