#pragma once

#include <Eigen/Core>
#include <vector>

#include "phantom/beam_profile.h"
#include "phantom/tissue_raster.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/scan_geometry.h"

namespace usct::phantom {

/// Attenuation and refraction of sound on a grid of the probe frame.
class AttenuationVolume {
 public:
  /// The effect of a tissue on sound, per mm of its path.
  struct Voxel {
    float db_per_mm;        // one way, at the transmit frequency
    float delay_mm_per_mm;  // range that the echo gains (or loses) by the tissue's own speed
    friend Voxel operator+(const Voxel& a, const Voxel& b) {
      return {a.db_per_mm + b.db_per_mm, a.delay_mm_per_mm + b.delay_mm_per_mm};
    }
    friend Voxel operator*(float factor, const Voxel& v) {
      return {factor * v.db_per_mm, factor * v.delay_mm_per_mm};
    }
  };
  static constexpr double kSpacingMm = 0.8;

  /// Covers the beams, which are in the probe frame.
  AttenuationVolume(const ScannedBody& body, const TissueRaster& raster, const BeamGrid& beams,
                    double frequency_mhz, const UltrasoundOptions& options);

  /// The value at the nearest voxel; outside the grid, that of the outermost ones.
  const Voxel& nearest(const Eigen::Vector3f& p_probe_mm) const {
    return voxels_[nearest_offset(p_probe_mm)];
  }
  bool refracts() const { return !index_gradient_.empty(); }
  /// Gradient of the logarithm of the refractive index at the nearest voxel, 1/mm. A ray bends by
  /// the integral of its part across the ray: by (difference of speed / speed) * tan(incidence) at
  /// a plane.
  const Eigen::Vector3f& index_gradient(const Eigen::Vector3f& p_probe_mm) const {
    return index_gradient_[nearest_offset(p_probe_mm)];
  }
  /// One-way loss by a bend of the ray, dB.
  float bend_loss_db(float bend_rad) const;

 private:
  void stamp_balls(const ScannedBody& body);
  void set_index_gradient(std::vector<float> log_index);
  std::size_t nearest_offset(const Eigen::Vector3f& p_probe_mm) const {
    const Eigen::Vector3f index = (p_probe_mm - origin_mm_) / static_cast<float>(kSpacingMm);
    const Eigen::Vector3i i = (index.array() + 0.5F).max(0.0F).cast<int>().min(size_.array() - 1);
    return (static_cast<std::size_t>(i.z()) * static_cast<std::size_t>(size_.y()) +
            static_cast<std::size_t>(i.y())) *
               static_cast<std::size_t>(size_.x()) +
           static_cast<std::size_t>(i.x());
  }

  Eigen::Vector3f origin_mm_;
  Eigen::Vector3i size_;
  std::vector<Voxel> voxels_;
  float edge_shadows_;
  std::vector<Eigen::Vector3f> index_gradient_;  // empty without edge shadows
};

/// The sound that remains at the points of one frame: two-way amplitude, averaged over the rays of
/// the aperture (so that shadows have soft edges), and delays.
struct TransmissionMap {
  static constexpr int kLineStep = 2;
  static constexpr double kDepthStepMm = 1.5;

  int lines = 0;             // nodes
  int depths = 0;            // nodes
  std::vector<float> level;  // two-way amplitude, 1 without loss
  std::vector<float> delay_mm;

  struct Value {
    float level;
    float delay_mm;
  };
  /// The value at a continuous line and a depth below the array.
  Value at(float line, float depth_mm) const;
  std::size_t offset(int line_node, int depth_node) const {
    return static_cast<std::size_t>(line_node) * static_cast<std::size_t>(depths) +
           static_cast<std::size_t>(depth_node);
  }
};

/// `T_probe_frame` maps frame coordinates to the probe frame.
TransmissionMap make_transmission_map(const AttenuationVolume& attenuation,
                                      const BeamProfile& profile, const Array& array, int lines,
                                      double deepest_mm, const Eigen::Isometry3d& T_probe_frame,
                                      double elevation_aperture_mm);

}  // namespace usct::phantom
