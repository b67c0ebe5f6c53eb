#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "phantom/deformation.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/phantom/anatomy.h"
#include "us_ct_registration/progress.h"

namespace usct::phantom {

/// The anatomy as the probe sees it: displaced as during the ultrasound, with gel instead of the
/// air between array and skin.
class ScannedBody {
 public:
  /// `apices_probe_mm`: middles of the array's surface along the sweep, in the probe frame.
  ScannedBody(const Scene& scene, const Placement& placement,
              std::vector<Eigen::Vector3d> apices_probe_mm);

  const Scene& scene() const { return scene_; }
  const Placement& placement() const { return placement_; }
  Tissue tissue(const Eigen::Vector3d& p_ct_mm) const;

 private:
  const Scene& scene_;
  const Placement& placement_;
  std::vector<Eigen::Vector3d> apices_probe_mm_;
};

/// The tissue at those nodes of a lattice that beams pass. The lattice is fixed in CT coordinates,
/// with the node (i, j, k) at `kPitchMm * (i, j, k)`, so that scatterers that belong to a node do
/// not move when the sweep changes.
class TissueRaster {
 public:
  static constexpr double kPitchMm = 0.6;
  static constexpr int kBlock = 8;  // nodes per axis
  static constexpr double kBlockMm = kPitchMm * kBlock;

  /// `beams` in the probe frame.
  TissueRaster(const ScannedBody& body, const BeamGrid& beams, const Progress& progress);

  /// The first nodes of the blocks that beams pass through or near.
  const std::vector<Eigen::Vector3i>& blocks() const { return blocks_; }

  /// Tissue of the node, which must belong to a block or be next to one.
  Tissue node(const Eigen::Vector3i& n) const { return static_cast<Tissue>(tissue_[offset(n)]); }
  /// Tissue at the nearest node; gel (transparent) away from the beams.
  Tissue nearest(const Eigen::Vector3d& p_ct_mm) const;

 private:
  std::size_t offset(const Eigen::Vector3i& n) const {
    const Eigen::Vector3i local = n - first_;
    return (static_cast<std::size_t>(local.z()) * static_cast<std::size_t>(size_.y()) +
            static_cast<std::size_t>(local.y())) *
               static_cast<std::size_t>(size_.x()) +
           static_cast<std::size_t>(local.x());
  }

  Eigen::Vector3i first_;  // node
  Eigen::Vector3i size_;   // nodes
  std::vector<std::uint8_t> tissue_;
  std::vector<Eigen::Vector3i> blocks_;
};

}  // namespace usct::phantom
