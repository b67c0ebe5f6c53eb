#include "phantom/transmission.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "parallel.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using Eigen::Vector3i;

constexpr double kSpeedOfScannerMs = 1540.0;
constexpr float kRayStepMm = 0.8F;
// A bent ray arrives beside the line, and its neighbours are bent by other angles, so that sound is
// spread. The loss per angle was chosen by eye: the sides of a kidney in fat then cast shadows of
// about 8 dB, those of a cyst in a kidney 3 dB. The limit keeps one interface from hiding all
// below.
constexpr float kLossDbPerRad = 25.0F;
constexpr float kLargestBendRad = 0.4F;

/// Rays of the aperture: positions as fractions of half the aperture and half the height, and
/// weights.
struct ApertureRay {
  float lateral, elevation, weight;
};
constexpr std::array<ApertureRay, 9> kRays = {{{0.0F, 0.0F, 0.18F},
                                               {-0.3F, 0.45F, 0.14F},
                                               {0.3F, -0.45F, 0.14F},
                                               {-0.55F, -0.3F, 0.12F},
                                               {0.55F, 0.3F, 0.12F},
                                               {-0.85F, 0.1F, 0.08F},
                                               {0.85F, -0.1F, 0.08F},
                                               {0.05F, 0.85F, 0.07F},
                                               {-0.05F, -0.85F, 0.07F}}};

/// The point of the array at a distance of `lateral_mm` along its surface from a line.
Vector3d element_mm(const Array& array, double line, double lateral_mm) {
  const Line at = line_in_frame(array, line);
  const auto* curved = std::get_if<CurvilinearArray>(&array);
  if (!curved) return at.origin_mm + Vector3d(lateral_mm, 0.0, 0.0);
  const double angle =
      std::atan2(at.direction.x(), at.direction.y()) + lateral_mm / curved->probe_radius_mm;
  return curved->probe_radius_mm * Vector3d(std::sin(angle), std::cos(angle), 0.0);
}

struct Along {
  float db;
  float delay_mm;
};
Along integrate(const AttenuationVolume& attenuation, const Vector3f& from, const Vector3f& to) {
  const Vector3f way = to - from;
  const float length = way.norm();
  const int steps = std::max(1, static_cast<int>(length / kRayStepMm));
  const Vector3f step = way / static_cast<float>(steps);
  Vector3f p = from + 0.5F * step;
  Along sum{0.0F, 0.0F};
  Vector3f gradient = Vector3f::Zero();
  for (int i = 0; i < steps; ++i, p += step) {
    const AttenuationVolume::Voxel& voxel = attenuation.nearest(p);
    sum.db += voxel.db_per_mm;
    sum.delay_mm += voxel.delay_mm_per_mm;
    if (attenuation.refracts()) gradient += attenuation.index_gradient(p);
  }
  const float step_mm = length / static_cast<float>(steps);
  sum = {sum.db * step_mm, sum.delay_mm * step_mm};
  if (attenuation.refracts()) {
    const Vector3f direction = way.normalized();
    const Vector3f bend = step_mm * (gradient - gradient.dot(direction) * direction);
    sum.db += attenuation.bend_loss_db(bend.norm());
  }
  return sum;
}

std::array<std::size_t, 3> strides(const Vector3i& size) {
  const auto row = static_cast<std::size_t>(size.x());
  return {1, row, row * static_cast<std::size_t>(size.y())};
}

/// Smooths a grid with weights 1/4, 1/2, 1/4 along each axis; the outermost voxels keep their
/// values.
template <typename T>
void smooth(std::vector<T>& voxels, const Vector3i& size) {
  const std::array<std::size_t, 3> stride = strides(size);
  for (int axis = 0; axis < 3; ++axis) {
    const int a = (axis + 1) % 3;
    const int b = (axis + 2) % 3;
    parallel_for(size[b], [&](int ib) {
      for (int ia = 0; ia < size[a]; ++ia) {
        T* row = voxels.data() +
                 static_cast<std::size_t>(ib) * stride[static_cast<std::size_t>(b)] +
                 static_cast<std::size_t>(ia) * stride[static_cast<std::size_t>(a)];
        const std::size_t s = stride[static_cast<std::size_t>(axis)];
        T before = row[0];
        for (int i = 1; i + 1 < size[axis]; ++i) {
          T& here = row[static_cast<std::size_t>(i) * s];
          const T& after = row[static_cast<std::size_t>(i + 1) * s];
          const T smoothed = 0.25F * before + 0.5F * here + 0.25F * after;
          before = here;
          here = smoothed;
        }
      }
    });
  }
}

}  // namespace

AttenuationVolume::AttenuationVolume(const ScannedBody& body, const TissueRaster& raster,
                                     const BeamGrid& beams, double frequency_mhz,
                                     const UltrasoundOptions& options)
    : edge_shadows_(static_cast<float>(options.edge_shadows)) {
  Eigen::AlignedBox3d box = beams.bounding_box();
  for (const Beam& beam : beams.beams) box.extend(beam.origin_mm);
  const Vector3d margin = Vector3d::Constant(6.0);
  origin_mm_ = (box.min() - margin).cast<float>();
  size_ = ((box.sizes() + 2.0 * margin) / kSpacingMm).array().ceil().cast<int>() + 1;
  voxels_.resize(static_cast<std::size_t>(size_.x()) * static_cast<std::size_t>(size_.y()) *
                 static_cast<std::size_t>(size_.z()));
  std::vector<float> log_index(options.edge_shadows > 0.0 ? voxels_.size() : 0);
  std::array<Voxel, kTissueCount> voxel_of;
  std::array<float, kTissueCount> log_index_of;
  for (int t = 0; t < kTissueCount; ++t) {
    const TissueProperties& p = body.scene().tissues[static_cast<Tissue>(t)];
    // Echoes from inside bone and gas have no meaningful depth.
    const double speed = is_strong_reflector(static_cast<Tissue>(t))
                             ? kSpeedOfScannerMs
                             : std::clamp(p.speed_m_s, 1400.0, 1700.0);
    voxel_of[static_cast<std::size_t>(t)] = {
        static_cast<float>(0.1 * p.attenuation_db_cm_mhz * frequency_mhz),
        static_cast<float>(options.tissue_speeds * (kSpeedOfScannerMs / speed - 1.0))};
    log_index_of[static_cast<std::size_t>(t)] =
        static_cast<float>(std::log(kSpeedOfScannerMs / speed));
  }
  parallel_for(size_.z(), [&](int k) {
    std::size_t n = static_cast<std::size_t>(k) * static_cast<std::size_t>(size_.y()) *
                    static_cast<std::size_t>(size_.x());
    for (int j = 0; j < size_.y(); ++j)
      for (int i = 0; i < size_.x(); ++i, ++n) {
        const Vector3d p = origin_mm_.cast<double>() + kSpacingMm * Vector3d(i, j, k);
        const auto tissue =
            static_cast<std::size_t>(raster.nearest(body.placement().ct_from_probe(p)));
        voxels_[n] = voxel_of[tissue];
        if (!log_index.empty()) log_index[n] = log_index_of[tissue];
      }
  });
  stamp_balls(body);
  smooth(voxels_, size_);
  if (!log_index.empty()) set_index_gradient(std::move(log_index));
}

void AttenuationVolume::stamp_balls(const ScannedBody& body) {
  // A ball stops sound over its own cross-section; its effect is spread over the voxel.
  for (const Ball& ball : body.scene().anatomy->balls()) {
    const Vector3f p = body.placement().probe_from_ct(ball.centre_ct_mm).cast<float>();
    const double share =
        std::min(1.0, 3.14 * ball.radius_mm * ball.radius_mm / (kSpacingMm * kSpacingMm));
    voxels_[nearest_offset(p)].db_per_mm += static_cast<float>(60.0 * share);
  }
}

void AttenuationVolume::set_index_gradient(std::vector<float> log_index) {
  // The voxels' steps would bend rays at random; a beam averages over about a millimetre.
  for (int i = 0; i < 2; ++i) smooth(log_index, size_);
  index_gradient_.assign(log_index.size(), Vector3f::Zero());
  const std::array<std::size_t, 3> stride = strides(size_);
  parallel_for(size_.z() - 2, [&](int plane) {
    for (int j = 1; j + 1 < size_.y(); ++j)
      for (int i = 1; i + 1 < size_.x(); ++i) {
        const std::size_t n = static_cast<std::size_t>(plane + 1) * stride[2] +
                              static_cast<std::size_t>(j) * stride[1] + static_cast<std::size_t>(i);
        for (int a = 0; a < 3; ++a) {
          const std::size_t step = stride[static_cast<std::size_t>(a)];
          index_gradient_[n][a] =
              (log_index[n + step] - log_index[n - step]) / static_cast<float>(2.0 * kSpacingMm);
        }
      }
  });
}

float AttenuationVolume::bend_loss_db(float bend_rad) const {
  return edge_shadows_ * kLossDbPerRad * std::min(bend_rad, kLargestBendRad);
}

TransmissionMap::Value TransmissionMap::at(float line, float depth_mm) const {
  const float u = std::clamp(line / kLineStep, 0.0F, static_cast<float>(lines - 1) - 1e-3F);
  const float v = std::clamp(depth_mm / static_cast<float>(kDepthStepMm), 0.0F,
                             static_cast<float>(depths - 1) - 1e-3F);
  const int i = static_cast<int>(u);
  const int j = static_cast<int>(v);
  const float fu = u - static_cast<float>(i);
  const float fv = v - static_cast<float>(j);
  const std::size_t n = offset(i, j);
  const auto blend = [&](const std::vector<float>& field) {
    const auto depth_count = static_cast<std::size_t>(depths);
    const float low = field[n] + fv * (field[n + 1] - field[n]);
    const float high =
        field[n + depth_count] + fv * (field[n + depth_count + 1] - field[n + depth_count]);
    return low + fu * (high - low);
  };
  return {blend(level), blend(delay_mm)};
}

TransmissionMap make_transmission_map(const AttenuationVolume& attenuation,
                                      const BeamProfile& profile, const Array& array, int lines,
                                      double deepest_mm, const Eigen::Isometry3d& T_probe_frame,
                                      double elevation_aperture_mm) {
  TransmissionMap map;
  map.lines = (lines - 1 + TransmissionMap::kLineStep) / TransmissionMap::kLineStep + 1;
  map.depths = static_cast<int>(deepest_mm / TransmissionMap::kDepthStepMm) + 2;
  map.level.resize(static_cast<std::size_t>(map.lines) * static_cast<std::size_t>(map.depths));
  map.delay_mm.resize(map.level.size());
  for (int i = 0; i < map.lines; ++i) {
    const double line = i * TransmissionMap::kLineStep;
    const Line centre = line_in_frame(array, line);
    for (int j = 0; j < map.depths; ++j) {
      const double depth = j * TransmissionMap::kDepthStepMm;
      const Vector3f point =
          (T_probe_frame * (centre.origin_mm + depth * centre.direction)).cast<float>();
      const double half = profile.half_aperture_mm(depth);
      float one_way = 0.0F;
      float delay = 0.0F;
      for (const ApertureRay& ray : kRays) {
        Vector3d element = element_mm(array, line, half * static_cast<double>(ray.lateral));
        element.z() = 0.5 * elevation_aperture_mm * static_cast<double>(ray.elevation);
        const Along along = integrate(attenuation, (T_probe_frame * element).cast<float>(), point);
        one_way += ray.weight * std::pow(10.0F, -0.05F * along.db);
        delay += ray.weight * along.delay_mm;
      }
      const std::size_t n = map.offset(i, j);
      map.level[n] = one_way * one_way;
      map.delay_mm[n] = delay;
    }
  }
  return map;
}

}  // namespace usct::phantom
