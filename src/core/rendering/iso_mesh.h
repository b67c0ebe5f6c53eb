#pragma once

#include <cstddef>

#include "us_ct_registration/rendering/surface.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

enum class Smoothing {
  /// For a mask, whose surface has the steps of the voxels.
  kAlways,
  /// For a field that rises across its surface. The surface is accurate as it is, but quadric
  /// decimation gets stuck at its slivers unless they are smoothed.
  kBeforeDecimation
};

/// Meshes by VTK, a module (module.h).
struct IsoMesh {
  static constexpr const char* kModule = "iso_mesh";

  /// The surface of `field` at `iso`, in the frame of the grid, mm; larger values are inside. It is
  /// closed if all voxels of the border are outside. A surface of more than `most_triangles` is
  /// decimated; it can keep somewhat more than that if no more edges can be removed.
  Surface (*mesh)(const Volume<float>& field, float iso, Smoothing smoothing,
                  std::size_t most_triangles);
};

}  // namespace usct
