#pragma once

#include <Eigen/Core>

#include "similarity/packed_ct.h"

namespace usct::registration {

/// Trilinear interpolation of a packed CT and the magnitude of its gradient.
class CtSampler {
 public:
  /// `ct` must outlive the object.
  explicit CtSampler(const PackedCt& ct);
  /// Fills a row of a lattice with HU above the lower end of the CT's window, and with HU/mm. The
  /// row begins at `first` and goes on by `step`, indices of the CT.
  void sample(const Eigen::Vector3d& first, const Eigen::Vector3d& step, std::size_t count,
              float* value, float* gradient) const;
  const Grid& grid() const { return ct_.grid(); }

 private:
  /// Value and gradient at an index, on the scales of the bytes.
  Eigen::Array2f at(const Eigen::Vector3d& index) const;

  const PackedCt& ct_;
  const PackedGradient packed_;
  const Eigen::Vector3d cells_;
};

}  // namespace usct::registration
