#include "us_ct_registration/similarity/simulated_lc2.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "require.h"
#include "similarity/simulated_lc2_images.h"
#include "similarity/simulated_lc2_kernel.h"
#include "simulation/fit_limits.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

using simulated_lc2::Block;
using simulated_lc2::BlockedUltrasound;
using simulated_lc2::DifferencedCt;
using simulated_lc2::kLinesPerBlock;
using simulated_lc2::Scene;
using simulated_lc2::Sums;

constexpr std::size_t kMostVoxels = std::size_t{1} << 30U;
/// Blocks that one thread follows at a time.
constexpr int kBlocksAtOnce = 8;

Scene described(const SimulationOptions& options, bool use_background) {
  const auto mu = [&](double hu) { return std::max(hu + options.hu_shift, options.mu_floor); };
  const IntensityMap& map = options.map;
  const double outside_p = map.slope * mu(options.outside_hu) + map.offset;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Scene scene{};
  scene.nearest = options.interpolation == Interpolation::kNearest;
  scene.windowed = options.window.has_value();
  scene.by_threshold = options.occlusion.by_threshold;
  scene.on_intensity = options.log_compression == LogCompression::kIntensity;
  scene.signed_reflection = options.signed_reflection;
  scene.use_background = use_background;
  scene.gas_hu = static_cast<float>(options.occlusion.gas_hu);
  scene.bone_hu = static_cast<float>(options.occlusion.bone_hu);
  scene.total_hu_per_mm = static_cast<float>(options.occlusion.gradient_hu_per_mm);
  scene.hu_shift = static_cast<float>(options.hu_shift);
  scene.mu_floor = static_cast<float>(options.mu_floor);
  scene.outside_mu = static_cast<float>(mu(options.outside_hu));
  scene.half_length_mm = static_cast<float>(0.5 * options.gradient_length_mm);
  scene.log_a = static_cast<float>(options.log_a);
  scene.reflection_scale = static_cast<float>(options.reflection_scale);
  scene.slope = static_cast<float>(map.slope);
  scene.outside_p = static_cast<float>(outside_p);
  scene.least_p = map.clamp ? 0.0F : -kInfinity;
  scene.most_p = map.clamp ? 255.0F : kInfinity;
  scene.p_origin = std::clamp(scene.outside_p, scene.least_p, scene.most_p);
  return scene;
}

/// Sum of (U - f)^2 over insonified samples, with f the best combination of p, r and 1. Of p and r
/// a constant one is left out, and one of them if they are collinear. NaN if neither varies.
double least_residual(const Sums& sums, double p_origin) {
  const auto n = static_cast<double>(sums.insonified);
  const auto is_constant = [&](double deviations, double squares, double mean) {
    return deviations <= kConstantBelow * (squares + n * mean * mean);
  };
  const double uu = sums.uu - sums.u * sums.u / n;
  const double pp = sums.pp - sums.p * sums.p / n;
  const double rr = sums.rr - sums.r * sums.r / n;
  const bool p_varies = !is_constant(pp, sums.pp, sums.p / n + p_origin);
  const bool r_varies = !is_constant(rr, sums.rr, sums.r / n);
  if (!p_varies && !r_varies) return std::numeric_limits<double>::quiet_NaN();
  const double up = p_varies ? (sums.up - sums.u * sums.p / n) / std::sqrt(pp) : 0.0;
  const double ur = r_varies ? (sums.ur - sums.u * sums.r / n) / std::sqrt(rr) : 0.0;
  const double c =
      p_varies && r_varies ? (sums.pr - sums.p * sums.r / n) / std::sqrt(pp) / std::sqrt(rr) : 0.0;
  // Uses the eigenvectors of the correlation matrix of p and r.
  double explained = 0.0;
  if (1.0 + c > kCollinearBelow) explained += 0.5 * (up + ur) * (up + ur) / (1.0 + c);
  if (1.0 - c > kCollinearBelow) explained += 0.5 * (up - ur) * (up - ur) / (1.0 - c);
  return std::max(0.0, uu - explained);
}

/// The residual with given weights.
double residual(const SimulationWeights& weights, const Sums& sums, double u_mean,
                double p_origin) {
  const auto n = static_cast<double>(sums.insonified);
  Eigen::Matrix4d moments;  // second moments of U, p, r and 1, relative to the origins of the sums
  moments << sums.uu, sums.up, sums.ur, sums.u,  //
      sums.up, sums.pp, sums.pr, sums.p,         //
      sums.ur, sums.pr, sums.rr, sums.r,         //
      sums.u, sums.p, sums.r, n;
  const Eigen::Vector4d w(1.0, -weights.mapped_ct, -weights.reflection,
                          u_mean - weights.mapped_ct * p_origin - weights.bias);
  return w.dot(moments * w);
}

class SimulatedLc2 final : public Similarity {
 public:
  using Similarity::evaluate;

  SimulatedLc2(const BeamUltrasound& ultrasound, const CtVolume& ct,
               const SimulationOptions& simulation, const FitOptions& fit)
      : beams_(ultrasound.beams),
        ultrasound_(ultrasound),
        ct_(ct, simulation.window),
        scene_(described(simulation, fit.use_background)),
        transmission_length_mm_(simulation.transmission_length_mm),
        occlusion_(simulation.occlusion),
        fit_(fit) {
    ct_.describe(scene_);
  }

  /// A block of beams is followed at all poses before the next one: poses of one generation are
  /// near each other, and find the CT in the cache.
  void evaluate(const SimilarityPose* poses, std::size_t count, SimilarityValue* values,
                const Check& check) const override {
    std::vector<Eigen::Affine3d> T_index_us;
    for (std::size_t i = 0; i < count; ++i) T_index_us.push_back(valid_T_index_us(poses[i]));
    const int blocks = ultrasound_.blocks();
    std::vector<std::vector<Sums>> parts(
        static_cast<std::size_t>((blocks + kBlocksAtOnce - 1) / kBlocksAtOnce));
    parallel_for(static_cast<int>(parts.size()), [&](int part) {
      if (check) check();
      std::vector<Sums>& sums = parts[static_cast<std::size_t>(part)];
      sums.resize(count);
      for (int block = part * kBlocksAtOnce; block < std::min(blocks, (part + 1) * kBlocksAtOnce);
           ++block)
        for (std::size_t i = 0; i < count; ++i)
          simulated_lc2::add_block(
              scene_, block_at(block, T_index_us[i], 1.0 + poses[i].errors.depth), sums[i]);
    });
    for (std::size_t i = 0; i < count; ++i) {
      Sums sums;
      for (const std::vector<Sums>& part : parts) sums += part[i];
      values[i] = value_of(sums);
    }
  }

 private:
  Eigen::Affine3d valid_T_index_us(const SimilarityPose& pose) const {
    const AcquisitionErrors& errors = pose.errors;
    require_rigid(pose.T_ct_us, "T_ct_us");
    require(std::isfinite(errors.depth) && errors.depth > -1.0, "acquisition errors", "depth",
            errors.depth, "finite and > -1");
    for (const auto& [name, error] :
         {std::pair("sweep", errors.sweep), std::pair("unevenness", errors.unevenness)})
      require(error == 0.0, "acquisition errors", name, error, "0: this metric does not know it");
    return ct_.grid().T_index_physical() * pose.T_ct_us;
  }

  Block block_at(int index, const Eigen::Affine3d& T_index_us, double stretch) const {
    Block block;
    ultrasound_.describe(index, block);
    const double start_mm = stretch * beams_.axial.start_depth_mm;
    const double spacing_mm = stretch * beams_.axial.spacing_mm;
    block.per_sample_mm = static_cast<float>(1.0 / spacing_mm);
    block.transmission_power =
        transmission_length_mm_ ? static_cast<float>(spacing_mm / *transmission_length_mm_) : 0.0F;
    block.echo_samples = occlusion_.echo_samples(spacing_mm);
    for (int lane = 0; lane < kLinesPerBlock; ++lane) {
      // Lanes beyond the last line hold no samples that count.
      const int line = std::min(ultrasound_.first_line(index) + lane, beams_.lines - 1);
      const Beam& beam = beams_.beam(ultrasound_.frame(index), line);
      const Eigen::Vector3d step = T_index_us.linear() * beam.direction;
      const Eigen::Vector3d first = T_index_us * beam.origin_mm + start_mm * step;
      for (int axis = 0; axis < 3; ++axis) {
        block.first[axis][lane] = static_cast<float>(first[axis]);
        block.step[axis][lane] = static_cast<float>(spacing_mm * step[axis]);
      }
    }
    return block;
  }

  SimilarityValue value_of(const Sums& sums) const {
    SimilarityValue result;
    if (ultrasound_.usable() == 0) return result;
    const auto in_body = static_cast<double>(sums.in_body);
    result.overlap = in_body / static_cast<double>(ultrasound_.usable());
    if (sums.in_body == 0 || result.overlap < fit_.min_overlap || sums.insonified == 0)
      return result;
    const auto n = static_cast<double>(sums.insonified + sums.occluded);
    const double u = sums.u + sums.u_occluded;
    const double squares = sums.uu + sums.uu_occluded;
    const double deviations = squares - u * u / n;
    const double mean = u / n + ultrasound_.mean();
    if (deviations <= kConstantBelow * (squares + n * mean * mean)) return result;
    const double insonified = fit_.fixed_weights ? residual(*fit_.fixed_weights, sums,
                                                            ultrasound_.mean(), scene_.p_origin)
                                                 : least_residual(sums, scene_.p_origin);
    const double occluded = sums.occluded > 0
                                ? sums.uu_occluded - sums.u_occluded * sums.u_occluded /
                                                         static_cast<double>(sums.occluded)
                                : 0.0;
    result.value = 1.0 - (insonified + occluded) / deviations;
    return result;
  }

  BeamGrid beams_;
  BlockedUltrasound ultrasound_;
  DifferencedCt ct_;
  Scene scene_;
  std::optional<double> transmission_length_mm_;
  OcclusionOptions occlusion_;
  FitOptions fit_;
};

}  // namespace

SimilarityNeeds SimulatedLc2Options::needs() const {
  SimilarityNeeds needs;
  needs.recorded_ct = true;
  needs.follows_depth_error = true;
  return needs;
}

void SimulatedLc2Options::validate(const std::string& source) const {
  simulation.validate(source + ".simulation");
  fit.validate(source + ".fit");
}

std::shared_ptr<const Similarity> make(SimilarityImages& images,
                                       const SimulatedLc2Options& options) {
  return make_simulated_lc2(images.ultrasound(), images.recorded_ct(), options.simulation,
                            options.fit);
}

std::shared_ptr<const Similarity> make_simulated_lc2(const BeamUltrasound& ultrasound,
                                                     const CtVolume& ct,
                                                     const SimulationOptions& simulation,
                                                     const FitOptions& fit) {
  ultrasound.beams.validate();
  ultrasound.validate();
  ct.validate("CT");
  require(ct.voxels.size() <= kMostVoxels, "CT", "voxels", static_cast<double>(ct.voxels.size()),
          "<= 2^30");
  simulation.validate();
  fit.validate();
  return std::make_shared<SimulatedLc2>(ultrasound, ct, simulation, fit);
}

}  // namespace usct
