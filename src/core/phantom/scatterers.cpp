#include "phantom/scatterers.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "parallel.h"
#include "random.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double kPitch = TissueRaster::kPitchMm;
// Interfaces of tissue are rough by a fraction of a wavelength, so that part of an echo is speckle.
constexpr double kRoughnessMm = 0.045;
constexpr double kSmallestReflection = 0.004;
// Level of the echo of a steel ball and of a bubble of 0.5 mm radius at the focus (cortex = 1).
constexpr float kSteelBallLevel = 45.0F;
constexpr float kBubbleLevel = 25.0F;

/// Impedance for normals only, limited so that bone and gas do not mask other tissue nearby.
double gentle_impedance(const TissueProperties& p) {
  return std::clamp(p.impedance_mrayl, 0.8, 2.6);
}

double reflection(const TissueProperties& a, const TissueProperties& b) {
  return (b.impedance_mrayl - a.impedance_mrayl) / (b.impedance_mrayl + a.impedance_mrayl);
}

class ScattererMaker {
 public:
  ScattererMaker(const ScannedBody& body, const TissueRaster& raster, int per_cell,
                 double echo_texture_db, std::uint64_t seed)
      : body_(body),
        raster_(raster),
        tissues_(body.scene().tissues),
        per_cell_(per_cell),
        echo_texture_db_(echo_texture_db),
        seed_(seed) {}

  ScattererField::Block make_block(const Vector3i& first) const {
    ScattererField::Block block;
    for (int k = 0; k < TissueRaster::kBlock; ++k)
      for (int j = 0; j < TissueRaster::kBlock; ++j)
        for (int i = 0; i < TissueRaster::kBlock; ++i) add_cell(first + Vector3i(i, j, k), block);
    enclose(first, block);
    return block;
  }

 private:
  using Corners = std::array<Tissue, 8>;

  static Vector3d corner(const Vector3i& cell, int n) {
    return kPitch * (cell + Vector3i(n & 1, (n >> 1) & 1, n >> 2)).cast<double>();
  }

  void enclose(const Vector3i& first, ScattererField::Block& block) const {
    const Vector3d middle =
        kPitch * first.cast<double>() + Vector3d::Constant(0.5 * TissueRaster::kBlockMm);
    block.centre_mm = body_.placement().probe_from_ct(middle).cast<float>();
    block.radius_mm = 0.0F;
    for (const Scatterer& s : block.volume)
      block.radius_mm = std::max(block.radius_mm, (s.p_mm - block.centre_mm).norm());
    for (const SurfaceScatterer& s : block.surface)
      block.radius_mm = std::max(block.radius_mm, (s.p_mm - block.centre_mm).norm());
  }

  void add_cell(const Vector3i& cell, ScattererField::Block& block) const {
    Corners corners;
    for (int n = 0; n < 8; ++n)
      corners[static_cast<std::size_t>(n)] =
          raster_.node(cell + Vector3i(n & 1, (n >> 1) & 1, n >> 2));
    const bool uniform_cell =
        std::all_of(corners.begin(), corners.end(), [&](Tissue t) { return t == corners[0]; });
    const std::uint64_t h = hash(seed_, cell.x(), cell.y(), cell.z());
    for (int n = 0; n < per_cell_; ++n) {
      const std::uint64_t own = hash(h, 100 + static_cast<std::uint64_t>(n));
      const Vector3d jitter(uniform(own), uniform(hash(own, 1)), uniform(hash(own, 2)));
      const Vector3d p = kPitch * (cell.cast<double>() + jitter);
      const Tissue tissue = uniform_cell ? corners[0] : body_.tissue(p);
      add_volume(p, tissue, own, block);
      if (!uniform_cell && n == 0) add_surface(cell, corners, p, tissue, h, block);
    }
  }

  void add_volume(const Vector3d& p, Tissue tissue, std::uint64_t h,
                  ScattererField::Block& block) const {
    const TissueProperties& properties = tissues_[tissue];
    if (properties.echogenicity_db < -200.0) return;
    const Anatomy& anatomy = *body_.scene().anatomy;
    double level_db = properties.echogenicity_db;
    if (properties.texture_db > 0.0)
      level_db += properties.texture_db * texture_at(anatomy, properties, tissue, p, seed_);
    if (properties.septa_db > 0.0)
      level_db += properties.septa_db * sheet_at(anatomy, properties, tissue, p, seed_);
    if (echo_texture_db_ > 0.0) level_db += echo_texture_db_ * echo_texture_at(tissue, p, seed_);
    // Strengths are Rayleigh-distributed with mean square 1, phases random by position: even sums
    // of few have the statistics of fully developed speckle (excess of the fourth moment 0).
    const double strength = std::sqrt(-std::log(1.0 - uniform(hash(h, 3))));
    const double amplitude = std::sqrt(kPitch * kPitch * kPitch / per_cell_) *
                             std::pow(10.0, level_db / 20.0) * strength;
    block.volume.push_back(
        {body_.placement().probe_from_ct(p).cast<float>(), static_cast<float>(amplitude)});
  }

  void add_surface(const Vector3i& cell, const Corners& corners, const Vector3d& p, Tissue tissue,
                   std::uint64_t h, ScattererField::Block& block) const {
    // The scatterer lies towards the corner that differs most from the cell's own scatterer.
    int towards = -1;
    double strongest = kSmallestReflection;
    for (int n = 0; n < 8; ++n) {
      const Tissue other = corners[static_cast<std::size_t>(n)];
      const double r =
          other == tissue ? 0.0 : std::abs(reflection(tissues_[tissue], tissues_[other]));
      if (r <= strongest) continue;
      strongest = r;
      towards = n;
    }
    if (towards < 0) return;
    Vector3d here = p;
    Vector3d there = corner(cell, towards);
    Tissue beyond = corners[static_cast<std::size_t>(towards)];
    for (int i = 0; i < 6; ++i) {
      const Vector3d middle = 0.5 * (here + there);
      const Tissue found = body_.tissue(middle);
      if (found == tissue) {
        here = middle;
      } else {
        there = middle;
        beyond = found;
      }
    }
    const double r = reflection(tissues_[tissue], tissues_[beyond]);
    if (std::abs(r) < kSmallestReflection) return;
    const Vector3d normal_ct = interface_normal(there);
    // A plane crosses |nx| + |ny| + |nz| cells per face of a cell.
    const double area = kPitch * kPitch / std::max(1.0, normal_ct.lpNorm<1>());
    const Vector3d q = here + kRoughnessMm * normal(hash(h, 5)) * normal_ct;
    SurfaceScatterer s;
    s.p_mm = body_.placement().probe_from_ct(q).cast<float>();
    s.normal = (body_.placement().T_probe_ct.linear() * normal_ct).cast<float>();
    s.amplitude = static_cast<float>(std::abs(r) * area * (0.6 + 0.8 * uniform(hash(h, 6))));
    s.is_gas = is_gas(tissue) || is_gas(beyond);
    s.is_strong = is_strong_reflector(tissue) || is_strong_reflector(beyond);
    s.hash = static_cast<std::uint32_t>(hash(h, 7));
    block.surface.push_back(s);
  }

  /// Direction of the steepest change of impedance, smoothed over about a millimetre.
  Vector3d interface_normal(const Vector3d& p_ct_mm) const {
    const Vector3i centre = (p_ct_mm / kPitch).array().round().cast<int>();
    constexpr std::array<double, 5> kWeight = {0.135, 0.607, 1.0, 0.607, 0.135};
    const double* middle = &kWeight[2];
    Vector3d gradient = Vector3d::Zero();
    for (int c = -2; c <= 2; ++c)
      for (int b = -2; b <= 2; ++b)
        for (int a = -2; a <= 2; ++a) {
          const double weight = middle[a] * middle[b] * middle[c];
          const Tissue t = raster_.node(centre + Vector3i(a, b, c));
          gradient += weight * gentle_impedance(tissues_[t]) * Vector3d(a, b, c);
        }
    const double norm = gradient.norm();
    return norm > 1e-6 ? Vector3d(gradient / norm) : Vector3d::Zero();
  }

  const ScannedBody& body_;
  const TissueRaster& raster_;
  const TissueTable& tissues_;
  int per_cell_;
  double echo_texture_db_;
  std::uint64_t seed_;
};

/// One echo of a fiducial or bubble, from the side that faces the probe.
ScattererField::Block ball_block(const ScannedBody& body, std::uint64_t seed) {
  ScattererField::Block block;
  const std::vector<Ball>& balls = body.scene().anatomy->balls();
  for (std::size_t i = 0; i < balls.size(); ++i) {
    SurfaceScatterer s;
    s.p_mm = body.placement().probe_from_ct(balls[i].centre_ct_mm).cast<float>();
    s.normal.setZero();
    s.ball_radius_mm = static_cast<float>(balls[i].radius_mm);
    s.is_gas = is_gas(balls[i].tissue);
    s.is_strong = true;
    s.amplitude = (s.is_gas ? kBubbleLevel : kSteelBallLevel) * s.ball_radius_mm / 0.5F;
    s.hash = static_cast<std::uint32_t>(hash(seed, 0xBA11, static_cast<std::int64_t>(i), 0));
    block.surface.push_back(s);
  }
  block.centre_mm.setZero();
  block.radius_mm = 1e6F;
  return block;
}

}  // namespace

ScattererField make_scatterers(const ScannedBody& body, const TissueRaster& raster, int per_cell,
                               double echo_texture_db, std::uint64_t seed,
                               const Progress& progress) {
  const ScattererMaker maker(body, raster, per_cell, echo_texture_db, seed);
  ScattererField field;
  field.blocks.resize(raster.blocks().size());
  parallel_for(
      static_cast<int>(field.blocks.size()),
      [&](int b) {
        const auto i = static_cast<std::size_t>(b);
        field.blocks[i] = maker.make_block(raster.blocks()[i]);
      },
      progress);
  field.blocks.push_back(ball_block(body, seed));
  return field;
}

}  // namespace usct::phantom
