#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <vector>

namespace usct {

/// Errors of an acquisition that a registration may estimate along with the pose. Both are
/// fractions, 0 where the recorded geometry is right.
struct AcquisitionErrors {
  /// Echoes lie at (1 + depth) times the recorded depth: what a wrong speed of sound does.
  double depth = 0.0;
  /// Frames lie (1 + sweep) times as far from the middle one as recorded: motor angle, or path of
  /// the tracked probe.
  double sweep = 0.0;
};

struct SimilarityValue {
  /// Higher is better; NaN where nothing can be said (no overlap at all).
  double value = std::numeric_limits<double>::quiet_NaN();
  /// Share of the ultrasound's samples that count which lie in the CT, in [0, 1].
  double overlap = 0.0;
};

/// How well a CT explains ultrasound at a pose. Both images and all options are fixed when it is
/// made (see the factories); it is then a function of the pose alone.
class Similarity {
 public:
  virtual ~Similarity() = default;

  /// `T_ct_us` maps the US frame to the CT's, mm; rigid. May be called from several threads at
  /// once; the same bits for the same pose, always.
  virtual SimilarityValue evaluate(const Eigen::Isometry3d& T_ct_us,
                                   const AcquisitionErrors& errors) const = 0;
  SimilarityValue evaluate(const Eigen::Isometry3d& T_ct_us) const {
    return evaluate(T_ct_us, AcquisitionErrors{});
  }

  /// What each part of the ultrasound (patch) contributes; the sum is `evaluate().value`. One part
  /// for a similarity that is not a sum.
  virtual std::vector<double> parts(const Eigen::Isometry3d& T_ct_us,
                                    const AcquisitionErrors& errors) const {
    return {evaluate(T_ct_us, errors).value};
  }
};

}  // namespace usct
