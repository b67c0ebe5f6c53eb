#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/volume/hu_window.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

class ReachedAverage;

/// A CT and, if they were prepared, its averages to the spacings of a registration. Averages depend
/// on the CT and on options alone, so that they are made once for all registrations of a CT. A
/// registration whose options have other spacings or another window averages the CT itself.
///
/// The result of a registration has the same bits with and without prepared averages. Several
/// threads may register with them at the same time. They take one byte per voxel and spacing: at
/// most half the memory of the CT for a spacing as fine as that of the CT, and less in proportion
/// to the volume of the averaged voxels. The part that registrations reach takes six bytes more
/// per voxel, since it is kept as the similarities read it.
class PreparedCt {
 public:
  /// A CT without averages. It must outlive this object.
  PreparedCt(const CtVolume& ct);  // NOLINT(google-explicit-constructor): as it is
  /// Prepares the averages of the search's levels and of the refinement, and those of the preset
  /// `patient` where the options leave doubts to it. `check` may throw to cancel; while this runs,
  /// the finest level of the search takes four bytes per voxel more. Throws InputError if the CT or
  /// the options are invalid.
  PreparedCt(const CtVolume& ct, const RegistrationOptions& options, const Check& check = {});
  ~PreparedCt();
  PreparedCt(const PreparedCt&) = delete;
  PreparedCt& operator=(const PreparedCt&) = delete;

  const CtVolume& ct() const { return ct_; }
  /// A number that no other object of the process has.
  std::uint64_t number() const { return number_; }
  /// The average by so many voxels along each axis, step by step, or null if it was not prepared.
  const ReachedAverage* find(const HuWindow& window,
                             const std::vector<Eigen::Vector3i>& steps) const;
  /// Memory of the averages, which grows with what registrations reach.
  std::size_t bytes() const;

 private:
  static std::uint64_t next_number();

  const CtVolume& ct_;
  const std::uint64_t number_ = next_number();
  std::vector<std::unique_ptr<const ReachedAverage>> averages_;
};

}  // namespace usct
