#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "us_ct_registration/io/volumes/label_table.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Triangles in the frame of the volume that they come from (LPS mm for a CT), anticlockwise as
/// seen from outside. The surface is closed: the border of the volume closes an object that it
/// cuts.
struct Surface {
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// The surface of each label that has voxels, by label: flying edges (marching cubes), smoothed
/// against the steps between voxels, and decimated to at most `most_triangles` by quadric error. A
/// label with many more triangles is meshed on a coarser, smoothed grid first; parts thinner than
/// that grid are then lost. A label of which less than half of the volume would be left is meshed
/// on a finer grid; if that cannot be decimated so far, its surface is what is left, possibly
/// nothing, and `loss_warning` names it. Smoothing shrinks structures of less than about five
/// voxels across. Throws InputError if `most_triangles` is < 1000.
std::map<int, Surface> label_surfaces(const LabelVolume& labels, std::size_t most_triangles);

/// A sentence that names the labels whose `surfaces`, those of `label_surfaces` with the same
/// arguments, keep less than three quarters of their volume, or end more than 5 mm before their
/// voxels do. Empty if there are none.
std::string loss_warning(const LabelVolume& labels, const std::map<int, Surface>& surfaces,
                         std::size_t most_triangles, const LabelTable& table);

/// A sentence that names the labels with voxels on the border of the volume: what they mark may go
/// on beyond it, and its surface ends in a plane there. Empty if there are none.
std::string border_warning(const LabelVolume& labels, const LabelTable& table);

/// Both sentences, as far as there are any.
std::vector<std::string> surface_warnings(const LabelVolume& labels,
                                          const std::map<int, Surface>& surfaces,
                                          std::size_t most_triangles, const LabelTable& table);

/// The surface of the voxels of the CT above `hu`, made in the same way, but smoothed only if it is
/// decimated.
Surface iso_surface(const CtVolume& ct, double hu, std::size_t most_triangles);

}  // namespace usct
