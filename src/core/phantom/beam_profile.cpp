#include "phantom/beam_profile.h"

#include <cmath>

#include "phantom/gaussian.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom {
namespace {

constexpr double kSpeedMmPerUs = 1.54;
// Width of the beam of an apodised aperture at its focus, in wavelengths times f-number.
constexpr double kDiffraction = 1.3;
// Opening of the geometric cone of an apodised aperture, out of focus.
constexpr double kCone = 0.6;
constexpr double kSmallestApertureMm = 2.0;

struct OneWay {
  double fwhm_mm;
  double curvature;
};

/// A beam focused once at `focus_mm`, in the manner of a Gaussian beam.
OneWay focused_beam(double aperture_mm, double focus_mm, double depth_mm, double wavelength_mm) {
  const double waist = kDiffraction * wavelength_mm * focus_mm / aperture_mm;
  const double off_focus = depth_mm - focus_mm;
  const double cone = kCone * aperture_mm * off_focus / focus_mm;
  const double waist_radius = waist / 1.18;
  const double rayleigh = kPi * waist_radius * waist_radius / wavelength_mm;
  return {std::hypot(waist, cone), off_focus / (off_focus * off_focus + rayleigh * rayleigh)};
}

}  // namespace

BeamProfile::BeamProfile(const UltrasoundOptions& options, double frequency_mhz,
                         double transmit_focus_mm, double sample_spacing_mm, double deepest_mm)
    : options_(options), wavelength_mm_(kSpeedMmPerUs / frequency_mhz) {
  // An echo is half as long as its pulse; the scanner filters before it takes samples.
  const double pulse_mm = 0.5 * options.pulse_cycles * wavelength_mm_;
  axial_sigma_mm_ = std::hypot(pulse_mm, sample_spacing_mm) / kFwhmPerSigma;
  const int count = static_cast<int>(deepest_mm * kStepsPerMm) + 2;
  double narrowest = 1e30;
  for (int i = 0; i < count; ++i) {
    const double depth = (i + 0.5) / kStepsPerMm;
    const OneWay transmit =
        focused_beam(options.aperture_mm, transmit_focus_mm, depth, wavelength_mm_);
    const double receive = kDiffraction * wavelength_mm_ *
                           std::max(options.f_number, depth / (2.0 * half_aperture_mm(depth)));
    const OneWay lens = focused_beam(options.elevation_aperture_mm, options.elevation_focus_mm,
                                     depth, wavelength_mm_);
    // Products of Gaussians have these widths.
    const double lateral = transmit.fwhm_mm * receive / std::hypot(transmit.fwhm_mm, receive);
    const double elevation = lens.fwhm_mm / std::sqrt(2.0);
    narrowest = std::min(narrowest, lateral * elevation);
    table_.push_back({static_cast<float>(lateral / kFwhmPerSigma),
                      static_cast<float>(elevation / kFwhmPerSigma),
                      static_cast<float>(transmit.curvature),
                      static_cast<float>(2.0 * lens.curvature), 0.0F, 0.0F});
  }
  narrowest /= kFwhmPerSigma * kFwhmPerSigma;
  for (BeamWidth& width : table_) {
    const double ratio =
        narrowest / (static_cast<double>(width.lateral_sigma_mm) * width.elevation_sigma_mm);
    width.speckle_scale = static_cast<float>(std::sqrt(ratio));
    width.plane_scale = static_cast<float>(ratio);
  }
  // With scattering cells of energy 1 per mm^3 the level is 1 (see ScattererField).
  smallest_cell_mm3_ = std::pow(kPi, 1.5) * axial_sigma_mm_ * narrowest;
  for (BeamWidth& width : table_)
    width.speckle_scale /= static_cast<float>(std::sqrt(smallest_cell_mm3_));
  for (BeamWidth& width : table_) width.plane_scale /= static_cast<float>(2.0 * kPi * narrowest);
}

double BeamProfile::half_aperture_mm(double depth_mm) const {
  return 0.5 * std::clamp(depth_mm / options_.f_number, kSmallestApertureMm, options_.aperture_mm);
}

}  // namespace usct::phantom
