#pragma once

#include <Eigen/Geometry>
#include <complex>
#include <vector>

#include "phantom/beam_profile.h"
#include "phantom/scatterers.h"
#include "phantom/transmission.h"
#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/phantom/ultrasound_options.h"

namespace usct::phantom {

/// Adds up the echoes of all scatterers along the lines of one frame: the demodulated signal
/// (in-phase and quadrature), so that neighbouring scatterers interfere and make speckle.
class FrameSynthesis {
 public:
  /// `geometry` is the true one.
  FrameSynthesis(const ScattererField& field, const BeamProfile& profile,
                 const UltrasoundOptions& options, const ScanGeometry& geometry);

  /// Echoes of a frame, lines x samples, samples fastest. `T_frame_probe` maps the scatterers to
  /// the frame.
  std::vector<std::complex<float>> echoes(const Eigen::Isometry3f& T_frame_probe,
                                          const TransmissionMap& transmission) const;

 private:
  /// Position of a scatterer relative to a frame.
  struct Place {
    float along;      // angle, or position of a linear array
    float line;       // continuous index
    float radius_mm;  // distance from the centre of curvature; 0: the array is flat
    float depth_mm;
    float y_mm;
    float z_mm;
  };
  struct Echo {
    float amplitude;
    float extra_range_mm;
    float turn;   // phase, in turns
    float widen;  // of the lateral beam
  };
  struct Signal;

  float depth_of(const Eigen::Vector3f& p_frame_mm) const;
  Place place_of(const Eigen::Vector3f& p_frame_mm) const;
  bool block_in_reach(const ScattererField::Block& block, const Eigen::Isometry3f& T) const;
  void add_volume(const Scatterer& scatterer, const Eigen::Isometry3f& T_frame_probe,
                  const TransmissionMap& transmission, Signal& signal) const;
  void add_surface(const SurfaceScatterer& scatterer, const Eigen::Isometry3f& T_frame_probe,
                   const TransmissionMap& transmission, Signal& signal) const;
  void add_ringing(const SurfaceScatterer& scatterer, const Place& place, const BeamWidth& width,
                   const Echo& first, Signal& signal) const;
  void add_echo(const Place& place, const BeamWidth& width, const Echo& echo, Signal& signal) const;

  const ScattererField& field_;
  const BeamProfile& profile_;
  const UltrasoundOptions& options_;
  const ScanGeometry& geometry_;
  bool curved_;
  float array_radius_mm_ = 0.0F;
  float axis_offset_mm_ = 0.0F;        // D of the motor
  std::vector<float> line_positions_;  // angles or mm
  std::vector<float> line_tilts_rad_;  // motor travel since the middle of the frame
  float largest_tilt_rad_ = 0.0F;
  MonotonicTable line_table_;
  bool evenly_spaced_;
  int taps_;
  std::vector<float> tap_table_;
};

}  // namespace usct::phantom
