#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>

#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

/// Images and starts without a right registration near the start; the registration must refuse
/// them.
namespace usct {

/// The same acquisition with the lines of each frame in reverse order: anatomy mirrored, as by a
/// picture that is flipped.
PreScanVolume lines_reversed(const PreScanVolume& ultrasound);

/// The same acquisition with its frames in reverse order: anatomy mirrored, as by a sweep that ran
/// the other way.
PreScanVolume frames_reversed(const PreScanVolume& ultrasound);

/// The rigid motion of the US frame that maps what an acquisition shows to where the same samples
/// are after both lines and frames were reversed: half a turn about the axis of the probe. It is
/// exact if lines and frames lie symmetrically, as those of a motorised probe do, else the best
/// rigid fit. Throws InputError if the geometry is invalid.
Eigen::Isometry3d half_turn(const ScanGeometry& ultrasound);

/// The CT mirrored, left for right (the x axis of LPS), with the point `centre_ct_mm` in place.
CtVolume mirrored_ct(CtVolume ct, const Eigen::Vector3d& centre_ct_mm);

/// The CT as if its second and third axes had been taken for each other: the rows of voxels along
/// either axis lie along the other, with their own spacing, and the point `centre_ct_mm` is in
/// place.
CtVolume axes_swapped_ct(CtVolume ct, const Eigen::Vector3d& centre_ct_mm);

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
