#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "similarity/packed_voxels.h"
#include "us_ct_registration/volume/operations.h"

namespace usct {

/// Packed voxels of a part of a volume.
struct PackedPart {
  std::shared_ptr<const PackedVoxels> voxels;
  /// The first of them in the whole volume.
  Eigen::Vector3i begin;
};

/// The average of a whole CT in bytes. The part of it that registrations reach is packed and kept,
/// so that those of one organ pack it once, and never pack the rest of the CT.
class ReachedAverage {
 public:
  /// `steps`: numbers of voxels along each axis that one step averages; the first step averages
  /// voxels of the CT, each other step those of the step before. `bytes` are on the scale of the
  /// window.
  ReachedAverage(const HuWindow& window, std::vector<Eigen::Vector3i> steps,
                 Volume<std::uint8_t> bytes);

  bool is_for(const HuWindow& window, const std::vector<Eigen::Vector3i>& steps) const;
  const Volume<std::uint8_t>& bytes() const { return bytes_; }
  /// A part that holds the region, which must not be empty. Safe from several threads.
  PackedPart over(const Region& region) const;
  /// Memory of the bytes, and of the part that is kept.
  std::size_t memory() const;

 private:
  HuWindow window_;
  std::vector<Eigen::Vector3i> steps_;
  Volume<std::uint8_t> bytes_;
  mutable std::mutex mutex_;  // of what follows
  mutable Region kept_;
  mutable std::shared_ptr<const PackedVoxels> packed_;
};

}  // namespace usct
