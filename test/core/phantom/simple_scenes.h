#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "phantom/echo_formation.h"
#include "us_ct_registration/phantom/anatomy.h"

/// Scenes whose ultrasound can be predicted: a rule gives the tissue at a point of the probe frame
/// (x lateral, y depth, z elevation, mm). CT and probe frame coincide.
namespace usct::phantom::test {

using TissueRule = std::function<Tissue(const Eigen::Vector3d& p_mm)>;

class RuledAnatomy : public Anatomy {
 public:
  RuledAnatomy(TissueRule rule, std::vector<Ball> balls) : rule_(std::move(rule)) {
    balls_ = std::move(balls);
  }
  Tissue tissue(const Eigen::Vector3d& p_mm) const override { return rule_(p_mm); }

 private:
  TissueRule rule_;
};

/// The tissues neither vary nor hold fibres.
inline Scene simple_scene(TissueRule rule, std::vector<Ball> balls = {}) {
  Scene scene;
  scene.anatomy = std::make_shared<RuledAnatomy>(std::move(rule), std::move(balls));
  scene.tissues = TissueTable::patient();
  for (int t = 0; t < kTissueCount; ++t) {
    scene.tissues[static_cast<Tissue>(t)].texture_db = 0.0;
    scene.tissues[static_cast<Tissue>(t)].septa_db = 0.0;
  }
  scene.kidney_centre_ct_mm = {0.0, 60.0, 0.0};
  scene.suggested_frequency_mhz = 5.0;
  return scene;
}

inline Scene homogeneous_scene(Tissue tissue) {
  return simple_scene([tissue](const Eigen::Vector3d&) { return tissue; });
}

/// A scanner without noise, haze, gain errors and TGC.
inline UltrasoundOptions ideal_scanner() {
  UltrasoundOptions options;
  options.time_gain_compensation = false;
  options.tgc_error_db = 0.0;
  options.lateral_gain_error_db = 0.0;
  options.frame_gain_error_db = 0.0;
  options.edge_loss_db = 0.0;
  options.clutter_db = -120.0;
  options.near_field_db = -120.0;
  options.penetration_mm = 1000.0;
  options.reverberation = 0.0;
  return options;
}

/// A small motorised sweep; the middle frame and line look along y.
inline SweepOptions small_sweep() {
  SweepOptions options;
  options.samples = 201;
  options.lines = 41;
  options.frames = 9;
  options.lateral_fov_deg = 20.0;
  options.elevation_fov_deg = 8.0;
  return options;
}

/// Envelope of a scene and the positions of its samples.
struct Echoes {
  std::vector<float> envelope;
  ScanGeometry geometry;

  double at(int sample, int line, int frame) const {
    return static_cast<double>(envelope[static_cast<std::size_t>(
        (frame * geometry.lines() + line) * geometry.samples() + sample)]);
  }
  int sample_at(double depth_mm) const {
    return static_cast<int>(
        std::lround((depth_mm - geometry.axial.start_depth_mm) / geometry.axial.spacing_mm));
  }
};

inline Echoes scan(const Scene& scene, const SweepOptions& sweep, double depth_mm,
                   const UltrasoundOptions& options, std::uint64_t seed = 1,
                   const Placement& placement = {}) {
  const Acquisition acquisition = make_acquisition(sweep, depth_mm, 1e6, seed);
  return {form_echoes(scene, placement, acquisition, options, seed), acquisition.recorded};
}

inline double decibels(double amplitude) { return 20.0 * std::log10(amplitude); }

/// Root mean square of the envelope over a block of samples, all lines and frames given.
inline double rms(const Echoes& e, int first_sample, int last_sample, int first_line,
                  int last_line) {
  double sum = 0.0;
  int count = 0;
  for (int f = 0; f < e.geometry.frames(); ++f)
    for (int l = first_line; l <= last_line; ++l)
      for (int s = first_sample; s <= last_sample; ++s, ++count) sum += std::pow(e.at(s, l, f), 2);
  return std::sqrt(sum / count);
}

}  // namespace usct::phantom::test
