#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "registration/run.h"
#include "registration/search/candidates.h"
#include "similarity/packed_ct.h"
#include "us_ct_registration/registration/starts.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct::registration {

/// Block matching (Ourselin 2000) over the whole region of a search: each block of the ultrasound
/// is compared with the CT at all translations, and the poses are those whose blocks explain most
/// together.
///
/// A climb leads to the right pose from a few millimetres away, and starts that happen to lie so
/// near are rare where contrast is low. A block does not mind a rotation that a climb would have to
/// find: it only lies elsewhere. A few rotations therefore suffice to compare the blocks, and the
/// sums over them cover all poses in between.
class BlockMatching {
 public:
  /// Conditioned ultrasound, `known` at the samples that count, not much farther apart than 2 mm;
  /// a CT at a spacing of about 2 mm; a region of poses around an initial one. It must cover both
  /// the ultrasound and the region.
  BlockMatching(std::shared_ptr<const BeamUltrasound> us, std::shared_ptr<const PackedCt> ct,
                const StartOptions& region);

  /// Whether blocks are matched in such a region.
  static bool covers(const StartOptions& region);
  /// Whether the field of view is small enough for a lattice of cells around all of it. A wrong
  /// pose of the tracker takes a frame metres away.
  static bool covers(const BeamUltrasound& us);

  /// Poses in the region around the initial pose, best first, `most` at most; those closer than
  /// `distinct_mm` count as one. A ball is searched as the box around it, unless it reaches turns
  /// that no box of rotation vectors covers evenly. The ultrasound lies where
  /// `mirror` moves it (see mirror_of). The value of a candidate is the sum over the blocks; there
  /// is none if the ultrasound has no block.
  std::vector<Candidate> poses(const Eigen::Isometry3d& T_us_ct_initial,
                               const Eigen::Isometry3d& mirror, const FieldPoints& field,
                               double distinct_mm, std::size_t most, Run& run) const;

 private:
  const std::shared_ptr<const BeamUltrasound> us_;
  const std::shared_ptr<const PackedCt> ct_;
  const StartOptions region_;
  const double cell_mm_;  // the edge of a cell of the ultrasound
};

}  // namespace usct::registration
