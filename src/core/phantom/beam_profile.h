#pragma once

#include <algorithm>
#include <vector>

#include "us_ct_registration/phantom/ultrasound_options.h"

namespace usct::phantom {

/// Width and wavefront of the two-way beam at one depth.
struct BeamWidth {
  float lateral_sigma_mm;
  float elevation_sigma_mm;
  /// Curvature of the transmitted wavefront, 1/mm; in elevation, of both ways together.
  float lateral_curvature;
  float elevation_curvature;
  /// 1 over the root of the energy of the cross-section, relative to the narrowest, so that the
  /// speckle of a tissue is equally bright at all depths.
  float speckle_scale;
  /// The scale for a plane: 1 over the area of the cross-section.
  float plane_scale;
};

/// The point spread of a focused array over depth: a transmit beam with a fixed focus, dynamic
/// receive focusing with constant f-number up to the largest aperture, and a lens out of plane.
class BeamProfile {
 public:
  BeamProfile(const UltrasoundOptions& options, double frequency_mhz, double transmit_focus_mm,
              double sample_spacing_mm, double deepest_mm);

  const BeamWidth& at(float depth_mm) const {
    const int i = static_cast<int>(depth_mm * kStepsPerMm);
    return table_[static_cast<std::size_t>(std::clamp(i, 0, static_cast<int>(table_.size()) - 1))];
  }
  /// Half the aperture used to receive from a depth, mm.
  double half_aperture_mm(double depth_mm) const;
  /// The volume from which a sample receives echoes, where the beam is narrowest.
  double smallest_resolution_cell_mm3() const { return smallest_cell_mm3_; }
  double wavelength_mm() const { return wavelength_mm_; }
  /// Standard deviation, along the beam, of the pulse after the filter that precedes sampling.
  double axial_sigma_mm() const { return axial_sigma_mm_; }

 private:
  static constexpr float kStepsPerMm = 4.0F;

  UltrasoundOptions options_;
  double wavelength_mm_;
  double axial_sigma_mm_;
  double smallest_cell_mm3_;
  std::vector<BeamWidth> table_;
};

}  // namespace usct::phantom
