#include "phantom/echo_formation.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "phantom/frame_synthesis.h"
#include "phantom/receiver.h"
#include "phantom/scatterers.h"
#include "phantom/stage.h"
#include "phantom/tissue_raster.h"
#include "phantom/transmission.h"
#include "us_ct_registration/geometry/beam_grid.h"

namespace usct::phantom {
namespace {

using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

/// Displacement of the anatomy by breathing during a frame, in the probe frame.
Vector3d breathing_probe_mm(const Placement& placement, const Acquisition& acquisition, int frame) {
  return acquisition.breathing_mm[static_cast<std::size_t>(frame)] *
         placement.T_probe_ct.linear().col(2);
}

/// The true beams relative to the anatomy without breathing, in the probe frame, from the array's
/// surface, since sound also passes the tissue above the first sample, to a depth.
BeamGrid beams_in_probe_frame(const Placement& placement, const Acquisition& acquisition,
                              double deepest_mm) {
  BeamGrid beams = beam_grid(acquisition.truth);
  AxialSampling& axial = beams.axial;
  axial.samples = static_cast<int>((deepest_mm - axial.start_depth_mm) / axial.spacing_mm) + 1;
  axial.samples += static_cast<int>(axial.start_depth_mm / axial.spacing_mm);
  axial.start_depth_mm = 0.0;
  const Isometry3d T_probe_us = acquisition.T_us_probe.inverse();
  for (std::size_t i = 0; i < beams.beams.size(); ++i) {
    Beam& beam = beams.beams[i];
    const int frame = static_cast<int>(i) / beams.lines;
    beam.origin_mm =
        T_probe_us * beam.origin_mm - breathing_probe_mm(placement, acquisition, frame);
    beam.direction = T_probe_us.linear() * beam.direction;
  }
  return beams;
}

std::vector<Vector3d> apices(const BeamGrid& beams) {
  std::vector<Vector3d> result;
  const int step = std::max(1, beams.frames / 8);
  for (int f = 0; f < beams.frames; f += step)
    result.push_back(beams.beam(f, beams.lines / 2).origin_mm);
  return result;
}

Isometry3d T_us_middle_of(const Acquisition& acquisition, int frame) {
  return T_us_frame_of(acquisition.truth, frame, 0.5 * (acquisition.truth.lines() - 1));
}

/// The inverse of `T_frame_rest`.
Isometry3d T_rest_frame(const Placement& placement, const Acquisition& acquisition, int frame) {
  return Translation3d(-breathing_probe_mm(placement, acquisition, frame)) *
         (acquisition.T_us_probe.inverse() * T_us_middle_of(acquisition, frame));
}

/// Number of scatterers per cell for fully developed speckle at the narrowest point of the beam.
int scatterers_per_cell(const BeamProfile& profile) {
  constexpr double kPerResolutionCell = 6.0;
  const double lattice_cell_mm3 = std::pow(TissueRaster::kPitchMm, 3);
  const double needed =
      kPerResolutionCell * lattice_cell_mm3 / profile.smallest_resolution_cell_mm3();
  return std::clamp(static_cast<int>(std::ceil(needed)), 1, 8);
}

/// Copies the envelope of a frame to the frames that repeat its image.
void repeat_images(const Acquisition& acquisition, std::size_t per_frame,
                   std::vector<float>& envelope) {
  const int frames = acquisition.truth.frames();
  for (int f = 0; f < frames; ++f) {
    const int image = acquisition.image_of_frame[static_cast<std::size_t>(f)];
    if (image != f)
      std::copy_n(envelope.begin() + static_cast<std::ptrdiff_t>(per_frame) * image, per_frame,
                  envelope.begin() + static_cast<std::ptrdiff_t>(per_frame) * f);
  }
}

}  // namespace

Isometry3d T_frame_rest(const Placement& placement, const Acquisition& acquisition, int frame) {
  return T_us_middle_of(acquisition, frame).inverse() * acquisition.T_us_probe *
         Translation3d(breathing_probe_mm(placement, acquisition, frame));
}

std::vector<float> form_echoes(const Scene& scene, const Placement& placement,
                               const Acquisition& acquisition, const UltrasoundOptions& options,
                               std::uint64_t seed, const Progress& progress) {
  const ScanGeometry& geometry = acquisition.truth;
  options.validate(geometry.lines());
  const double frequency_mhz = options.frequency_mhz.value_or(scene.suggested_frequency_mhz);
  const double recorded_depth_mm = geometry.axial.depth_mm(geometry.samples() - 1);
  // A scanner that assumes too low a speed shows echoes from deeper than its nominal depth.
  const double deepest_mm =
      std::max(recorded_depth_mm, recorded_depth_mm / (1.0 + options.sound_speed_error)) + 5.0;
  const double kidney_depth_mm = (placement.probe_from_ct(scene.kidney_centre_ct_mm)).y();
  const double focus_mm = options.transmit_focus_mm.value_or(std::max(10.0, kidney_depth_mm));
  const BeamProfile profile(options, frequency_mhz, focus_mm, geometry.axial.spacing_mm,
                            deepest_mm);

  const BeamGrid beams = beams_in_probe_frame(placement, acquisition, deepest_mm);
  const ScannedBody body(scene, placement, apices(beams));
  const TissueRaster raster(body, beams, stage(progress, 0.0, 0.25));
  const ScattererField field =
      make_scatterers(body, raster, scatterers_per_cell(profile), options.echo_texture_db, seed,
                      stage(progress, 0.25, 0.45));
  const AttenuationVolume attenuation(body, raster, beams, frequency_mhz, options);

  std::vector<TransmissionMap> transmissions(static_cast<std::size_t>(geometry.frames()));
  parallel_for(
      geometry.frames(),
      [&](int f) {
        transmissions[static_cast<std::size_t>(f)] = make_transmission_map(
            attenuation, profile, geometry.array, geometry.lines(), deepest_mm,
            T_rest_frame(placement, acquisition, f), options.elevation_aperture_mm);
      },
      stage(progress, 0.45, 0.6));

  const FrameSynthesis synthesis(field, profile, options, geometry);
  const Receiver receiver(options, frequency_mhz, geometry, transmissions, seed);
  const std::size_t per_frame =
      static_cast<std::size_t>(geometry.lines()) * static_cast<std::size_t>(geometry.samples());
  std::vector<float> envelope(per_frame * static_cast<std::size_t>(geometry.frames()));
  parallel_for(
      geometry.frames(),
      [&](int f) {
        const auto n = static_cast<std::size_t>(f);
        if (acquisition.image_of_frame[n] != f) return;
        const std::vector<float> frame = receiver.envelope(
            synthesis.echoes(T_frame_rest(placement, acquisition, f).cast<float>(),
                             transmissions[n]),
            f);
        std::copy(frame.begin(), frame.end(),
                  envelope.begin() + static_cast<std::ptrdiff_t>(n * per_frame));
      },
      stage(progress, 0.6, 1.0));
  repeat_images(acquisition, per_frame, envelope);
  return envelope;
}

}  // namespace usct::phantom
