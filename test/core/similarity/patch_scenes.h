#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <memory>
#include <vector>

#include "core/geometry/random_geometry.h"
#include "core/simulation/simple_scenes.h"
#include "similarity/backend.h"
#include "us_ct_registration/similarity/catalogue.h"
#include "us_ct_registration/volume/sampling.h"

/// Scenes for the similarities of patches. The values of CTs are whole steps of a byte, so that
/// packing them loses nothing; beams are 1 mm apart in every direction, so that the samples of
/// patches of whole millimetres are known.
namespace usct::test {

constexpr HuWindow kWindow{-150.0, 360.0};  // 2 HU per step of a byte
constexpr double kBackgroundHu = 40.0;

/// One of 0, 1, ... 2^16 - 1, always the same for the same i.
inline double hashed(std::size_t i) {
  auto x = static_cast<std::uint32_t>(i) * 2654435761U;
  x ^= x >> 15;
  x *= 2246822519U;
  return static_cast<double>(x >> 16);
}

/// Offset of a sample in BeamUltrasound::brightness.
inline std::size_t offset_of(const BeamGrid& beams, int sample, int line, int frame) {
  return (static_cast<std::size_t>(frame) * static_cast<std::size_t>(beams.lines) +
          static_cast<std::size_t>(line)) *
             static_cast<std::size_t>(beams.samples()) +
         static_cast<std::size_t>(sample);
}

/// Waves with a period of several voxels, in oblique directions.
inline Volume<float> wavy_ct(const Grid& grid) {
  Volume<float> ct(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const double wave = std::sin(0.5 * i + 0.2 * k) + std::sin(0.4 * j - 0.3 * i) +
                            std::sin(0.45 * k + 0.2 * j);
        ct.at(i, j, k) = static_cast<float>(100.0 + 2.0 * std::round(35.0 * wave));
      }
  return ct;
}

inline Grid oblique_grid(const Eigen::Vector3i& size, const Eigen::Vector3d& spacing_mm) {
  Grid grid;
  grid.size = size;
  grid.spacing_mm = spacing_mm;
  grid.direction =
      Eigen::AngleAxisd(0.4, Eigen::Vector3d(1.0, -2.0, 0.5).normalized()).toRotationMatrix();
  grid.origin_mm = -grid.centre_mm();
  return grid;
}

/// Noise that has no relation to any CT.
inline BeamUltrasound noisy_ultrasound(const BeamGrid& beams) {
  BeamUltrasound us{beams, {}, {}};
  const std::size_t count = beams.beams.size() * static_cast<std::size_t>(beams.samples());
  for (std::size_t i = 0; i < count; ++i)
    us.brightness.push_back(
        static_cast<float>(50.0 + hashed(i) / 2000.0 + 10.0 * std::sin(0.01 * double(i))));
  return us;
}

/// The CT at a sample of the ultrasound, computed by the definitions.
struct Seen {
  double u = 0.0;
  double ct_hu = kBackgroundHu;
  double gradient = 0.0;  // HU/mm
  bool inside = false;
  double depth_mm = 0.0;
};

inline Seen seen_at(const BeamUltrasound& us, int sample, int line, int frame,
                    const Volume<float>& ct, const Eigen::Isometry3d& T_ct_us,
                    GradientChannel channel) {
  Seen seen;
  const BeamGrid& beams = us.beams;
  seen.u = us.brightness[offset_of(beams, sample, line, frame)];
  seen.depth_mm = beams.axial.depth_mm(sample);
  const Eigen::Vector3d index =
      ct.grid.index_from_physical(T_ct_us * beams.point(frame, line, sample));
  const Eigen::Vector3d lower = index.array().floor();
  if ((index.array() < 0.0).any() ||
      (index.array() >= ct.grid.size.cast<double>().array() - 1.0).any())
    return seen;
  const auto value = [&](const Eigen::Vector3d& at) {
    return static_cast<double>(sample_at_index(ct, at, Interpolation::kTrilinear, Outside::edge()));
  };
  // Trilinear interpolation is linear along each axis of a cell.
  Eigen::Vector3d slope;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3d start = index;
    Eigen::Vector3d end = index;
    start[axis] = lower[axis];
    end[axis] = lower[axis] + 1.0;
    slope[axis] = (value(end) - value(start)) / ct.grid.spacing_mm[axis];
  }
  const Eigen::Vector3d gradient = ct.grid.direction * slope;
  seen.ct_hu = value(index);
  seen.gradient =
      channel == GradientChannel::kMagnitude
          ? gradient.norm()
          : std::abs(gradient.dot(T_ct_us.linear() * beams.beam(frame, line).direction));
  seen.inside = true;
  return seen;
}

/// The samples of boxes of `edge` samples, lines and frames, with beams 1 mm apart, for boxes of
/// which at least half is known.
inline std::vector<std::vector<Seen>> seen_by_patches(const BeamUltrasound& us, int edge,
                                                      const Volume<float>& ct,
                                                      const Eigen::Isometry3d& T_ct_us,
                                                      GradientChannel channel) {
  std::vector<std::vector<Seen>> patches;
  const Eigen::Vector3i size(us.beams.samples(), us.beams.lines, us.beams.frames);
  for (int f0 = 0; f0 < size.z(); f0 += edge)
    for (int l0 = 0; l0 < size.y(); l0 += edge)
      for (int s0 = 0; s0 < size.x(); s0 += edge) {
        std::vector<Seen> patch;
        std::size_t places = 0;
        for (int f = f0; f < std::min(size.z(), f0 + edge); ++f)
          for (int l = l0; l < std::min(size.y(), l0 + edge); ++l)
            for (int s = s0; s < std::min(size.x(), s0 + edge); ++s) {
              ++places;
              const std::size_t i = offset_of(us.beams, s, l, f);
              if (us.known.empty() || us.known[i] != 0)
                patch.push_back(seen_at(us, s, l, f, ct, T_ct_us, channel));
            }
        if (patch.size() >= 2 && 2 * patch.size() >= places) patches.push_back(patch);
      }
  return patches;
}

inline std::vector<Seen> all_of(const std::vector<std::vector<Seen>>& patches) {
  std::vector<Seen> all;
  for (const auto& patch : patches) all.insert(all.end(), patch.begin(), patch.end());
  return all;
}

inline PatchOptions cubes(double edge_mm) { return {edge_mm, edge_mm, edge_mm, 0.5}; }

inline std::shared_ptr<const Similarity> similarity_of(
    const BeamUltrasound& us, const Volume<float>& ct, const SimilarityOptions& options,
    const SimilarityBackend& backend = simd_backend()) {
  SimilarityImages images(std::make_shared<const BeamUltrasound>(us),
                          pack_ct(ct, kWindow, kBackgroundHu), nullptr, true, backend);
  return make_similarity(images, options);
}

inline SimilarityValue value_at(const Similarity& similarity, const Eigen::Isometry3d& T_ct_us,
                                const AcquisitionErrors& errors = {}) {
  return similarity.evaluate(SimilarityPose{T_ct_us, errors});
}

/// A random pose that is turned and shifted by at most +-`turn_rad` and +-`reach_mm`.
inline Eigen::Isometry3d random_small_pose(double turn_rad, double reach_mm) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d axis(uniform(-1, 1), uniform(-1, 1), uniform(0.1, 1));
  T.linear() =
      Eigen::AngleAxisd(uniform(-turn_rad, turn_rad), axis.normalized()).toRotationMatrix();
  for (int i = 0; i < 3; ++i) T.translation()[i] = uniform(-reach_mm, reach_mm);
  return T;
}

/// The default options of all metrics of patches.
inline std::vector<SimilarityOptions> all_metrics() {
  std::vector<SimilarityOptions> metrics;
  for (const std::string& name : similarity_names()) {
    const SimilarityOptions options = similarity_named(name, "test");
    if (needs_of(options).patches) metrics.push_back(options);
  }
  return metrics;
}

inline PatchOptions& patches_of(SimilarityOptions& options) {
  PatchOptions* found = nullptr;
  std::visit(
      [&](auto& metric) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(metric)>, SimulatedLc2Options>)
          found = &metric.patches;
      },
      options);
  return *found;
}

}  // namespace usct::test
