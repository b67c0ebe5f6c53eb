#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/volume/volume.h"

namespace usct {

/// The part of a CT that is kept, and the limits of its size.
struct CtSelection {
  static constexpr int kMostDecimation = 16;

  /// A box along the axes of patient coordinates (LPS), mm: the smallest block of voxels that
  /// covers it is kept. Empty: all.
  std::optional<Eigen::AlignedBox3d> box_mm;
  /// Each block of so many voxels along each axis becomes one, the value after smoothing at its
  /// centre; in [1, kMostDecimation].
  int decimation = 1;
  /// Greatest size of the voxels as they are stored, decompressed, and of those that are kept.
  std::uint64_t max_stored_bytes = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t max_kept_bytes = std::numeric_limits<std::uint64_t>::max();

  /// Throws InputError naming the field, its value and the constraint.
  void validate() const;
};

/// Throws InputError, naming `source`, if voxels of a size of `voxel_bytes` on this grid, or those
/// of them that are kept, exceed the limits, if the box contains no voxel, or if it is thinner than
/// the decimation. Readers call it before they allocate or decompress anything.
void require_fits(const CtSelection& selection, const Grid& grid, std::size_t voxel_bytes,
                  const std::string& source);

/// The part of the CT that is kept; adds what was left out to `warnings`.
CtVolume selected(CtVolume ct, const CtSelection& selection, std::vector<std::string>& warnings);

}  // namespace usct
