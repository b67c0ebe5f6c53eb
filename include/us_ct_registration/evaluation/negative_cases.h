#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>

#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

/// Ultrasound and starts without a right registration; the registration must refuse them.
namespace usct {

/// The same acquisition with the lines of each frame in reverse order: anatomy mirrored, as by a
/// probe held the wrong way round.
PreScanVolume mirrored(const PreScanVolume& ultrasound);

/// The size of speckle: standard deviations of the Gaussian point spread.
struct SpeckleOptions {
  double axial_mm = 0.3;
  double lateral_mm = 1.0;
  double elevation_mm = 1.5;

  /// Throws InputError, naming `source`, unless all are finite and >= 0.
  void validate(const std::string& source) const;
};

/// Ultrasound without any anatomy: fully developed speckle (a complex Gaussian field, smoothed by
/// the point spread as it is in the middle of the depths; its amplitude is Rayleigh distributed),
/// log-compressed to the usual 60 dB. Its mean grey value at each depth is that of `ultrasound`, as
/// far as 8 bits hold it. The same seed gives the same bits.
PreScanVolume speckle_only(const PreScanVolume& ultrasound, std::uint64_t seed,
                           const SpeckleOptions& options = {});

/// A pose that looks right for the CT of another kidney: oriented as `T_us_ct`, with the point
/// `centre_other_ct_mm` of the other CT where `centre_us_mm` is in the US frame.
Eigen::Isometry3d pose_of_other_ct(const Eigen::Isometry3d& T_us_ct,
                                   const Eigen::Vector3d& centre_us_mm,
                                   const Eigen::Vector3d& centre_other_ct_mm);

/// `T_us_ct` followed by a translation in a random direction that leaves at least `gap_mm` between
/// the CT and the field of view.
Eigen::Isometry3d moved_apart(const Eigen::Isometry3d& T_us_ct, const Grid& ct,
                              const ScanGeometry& ultrasound, double gap_mm, std::uint64_t seed);

}  // namespace usct
