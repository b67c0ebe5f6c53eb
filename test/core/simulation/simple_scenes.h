#pragma once

#include <cmath>
#include <functional>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/volume/volume.h"

/// CTs given by a formula and beams along +y, where the answers are known by hand.
namespace usct::test {

/// Isotropic voxels around the origin.
inline Grid centred_grid(int size, double spacing_mm) {
  Grid grid;
  grid.size.setConstant(size);
  grid.spacing_mm.setConstant(spacing_mm);
  grid.origin_mm.setConstant(-0.5 * (size - 1) * spacing_mm);
  return grid;
}

inline CtVolume ct_of(const Grid& grid, const std::function<double(const Eigen::Vector3d&)>& hu) {
  CtVolume ct(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        ct.at(i, j, k) = static_cast<std::int16_t>(
            std::lround(hu(grid.physical_from_index(Eigen::Vector3d(i, j, k)))));
  return ct;
}

/// Parallel beams along +y from y = -(samples - 1) / 2, 1 mm between samples, lines (x) and frames
/// (z), around the origin.
inline BeamGrid downward_beams(int samples, int lines, int frames) {
  BeamGrid beams;
  beams.axial = {samples, 0.0, 1.0};
  beams.lines = lines;
  beams.frames = frames;
  for (int frame = 0; frame < frames; ++frame)
    for (int line = 0; line < lines; ++line)
      beams.beams.push_back(
          {{line - 0.5 * (lines - 1), -0.5 * (samples - 1), frame - 0.5 * (frames - 1)},
           {0.0, 1.0, 0.0}});
  return beams;
}

}  // namespace usct::test
