#include "us_ct_registration/simulation/simulation.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "parallel.h"
#include "require.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

constexpr double kMostEchoMm = 50.0;

/// The CT values at a point and one voxel ahead and behind along each index axis, with these points
/// kept within the CT.
class Stencil {
 public:
  Stencil(const CtVolume& ct, Eigen::Vector3d index, Interpolation interpolation) {
    const Eigen::Vector3d last = (ct.grid.size - Eigen::Vector3i::Ones()).cast<double>();
    index = index.cwiseMax(0.0).cwiseMin(last);
    if (interpolation == Interpolation::kNearest) index = (index.array() + 0.5).floor();
    const auto value = [&](const Eigen::Vector3d& at) -> double {
      return sample_at_index(ct, at, interpolation, Outside::edge());
    };
    centre_ = value(index);
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector3d ahead = index;
      Eigen::Vector3d behind = index;
      ahead[axis] = std::min(index[axis] + 1.0, last[axis]);
      behind[axis] = std::max(index[axis] - 1.0, 0.0);
      ahead_[axis] = value(ahead);
      behind_[axis] = value(behind);
      voxels_apart_[axis] = ahead[axis] - behind[axis];
    }
  }

  double centre() const { return centre_; }
  double lowest() const { return std::min({centre_, ahead_.minCoeff(), behind_.minCoeff()}); }

  /// Gradient in the frame of the CT, HU per mm; 0 along an axis of one voxel.
  Eigen::Vector3d gradient(const Grid& grid) const {
    Eigen::Vector3d along_axes = Eigen::Vector3d::Zero();
    for (int axis = 0; axis < 3; ++axis)
      if (voxels_apart_[axis] > 0.0)
        along_axes[axis] =
            (ahead_[axis] - behind_[axis]) / (voxels_apart_[axis] * grid.spacing_mm[axis]);
    return grid.direction * along_axes;
  }

 private:
  double centre_ = 0.0;
  Eigen::Vector3d ahead_;
  Eigen::Vector3d behind_;
  Eigen::Vector3d voxels_apart_;
};

/// Tissue at one sample.
struct Medium {
  double ct_hu;
  double mu;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  // gradient of mu, HU per mm, CT frame
  std::uint8_t flags = 0;
};

/// A beam hands this state from sample to sample.
struct Sound {
  double intensity = 1.0;  // I, eqs 4.5 and 4.6
  /// Samples for which the surface where I became 0 still echoes, and its r (eq 4.5).
  int echo_samples = 0;
  double echo = 0.0;
};

class BeamSimulator {
 public:
  BeamSimulator(const BeamGrid& beams, const CtVolume& ct, const Eigen::Isometry3d& T_ct_us,
                const SimulationOptions& options, SimulatedComponents& result)
      : beams_(beams), ct_(ct), T_ct_us_(T_ct_us), options_(options), result_(result) {
    if (options.window) limited_ = limited_to(*options.window, ct);
  }

  void simulate(int line, int frame) const {
    const Eigen::Vector3d direction_ct = T_ct_us_.linear() * beams_.beam(frame, line).direction;
    Sound sound;
    bool in_body = false;
    for (int sample = 0; sample < beams_.samples(); ++sample) {
      const Medium medium = medium_at(T_ct_us_ * beams_.point(frame, line, sample), in_body);
      propagate(medium, direction_ct, sound, result_.offset(sample, line, frame));
    }
  }

 private:
  Medium medium_at(const Eigen::Vector3d& p_ct, bool& in_body) const {
    Medium medium{options_.outside_hu, mu(options_.outside_hu)};
    const Eigen::Vector3d index = ct_.grid.index_from_physical(p_ct);
    if (!contains_index(ct_.grid, index)) {
      medium.flags = kOutsideCt;
      return medium;
    }
    const Stencil stencil(ct_, index, options_.interpolation);
    medium.ct_hu = stencil.centre();
    in_body = in_body || stencil.lowest() >= options_.occlusion.gas_hu;
    if (!in_body) {
      medium.flags = kBeforeBody;
      return medium;
    }
    const Stencil seen =
        options_.window ? Stencil(limited_, index, options_.interpolation) : stencil;
    medium.mu = mu(seen.centre());
    medium.gradient = seen.gradient(ct_.grid);
    return medium;
  }

  double mu(double hu) const { return std::max(hu + options_.hu_shift, options_.mu_floor); }

  bool reflects_totally(const Medium& medium) const {
    const OcclusionOptions& occlusion = options_.occlusion;
    return occlusion.by_threshold && (medium.flags & (kOutsideCt | kBeforeBody)) == 0 &&
           (medium.ct_hu >= occlusion.bone_hu || medium.ct_hu < occlusion.gas_hu ||
            medium.gradient.norm() >= occlusion.gradient_hu_per_mm);
  }

  /// Computes eqs 4.3-4.8 at one sample from the sound behind the sample before, and updates that.
  void propagate(const Medium& medium, const Eigen::Vector3d& direction_ct, Sound& sound,
                 std::size_t at) const {
    const double length = options_.gradient_length_mm;
    const double twice_mu = 2.0 * medium.mu;
    const double gradient = medium.gradient.norm();
    const double along_beam = direction_ct.dot(medium.gradient);
    double delta_r =
        std::clamp(along_beam * gradient * length * length / (twice_mu * twice_mu), -1.0, 1.0);
    const double change = gradient * length / twice_mu;
    double t = std::max(0.0, 1.0 - change * change);
    if (reflects_totally(medium)) {
      delta_r = std::copysign(1.0, along_beam);
      t = 0.0;
    }
    double r = sound.intensity * delta_r;
    const double intensity = sound.intensity * over_one_sample(t);
    if (sound.intensity > 0.0 && intensity == 0.0)
      sound = {intensity, options_.occlusion.echo_samples(beams_.axial.spacing_mm), r};
    sound.intensity = intensity;
    const bool echoes = sound.echo_samples > 0;
    if (echoes) {
      r = sound.echo;
      --sound.echo_samples;
    }

    result_.ct_hu[at] = static_cast<float>(medium.ct_hu);
    result_.gradient_hu_per_mm[at] = static_cast<float>(gradient);
    result_.reflection_coefficient[at] = static_cast<float>(delta_r);
    result_.transmission[at] = static_cast<float>(t);
    result_.intensity[at] = static_cast<float>(intensity);
    result_.reflection[at] = static_cast<float>(compressed(r, intensity));
    result_.mapped_ct[at] = static_cast<float>(mapped(medium.mu));
    result_.flags[at] =
        static_cast<std::uint8_t>(medium.flags | (intensity > 0.0 || echoes ? 0 : int{kOccluded}));
  }

  double over_one_sample(double t) const {
    if (!options_.transmission_length_mm) return t;
    return std::pow(t, beams_.axial.spacing_mm / *options_.transmission_length_mm);
  }

  /// Log compression, eq 4.7.
  double compressed(double r, double intensity) const {
    const double whole = std::log1p(options_.log_a);
    if (options_.log_compression == LogCompression::kIntensity)
      return 1.0 - std::log1p(options_.log_a * intensity) / whole;
    const double strength = std::min(1.0, options_.reflection_scale * std::abs(r));
    const double value = std::log1p(options_.log_a * strength) / whole;
    return options_.signed_reflection ? std::copysign(value, r) : value;
  }

  /// Mapped CT value, eq 4.8.
  double mapped(double mu) const {
    const double p = options_.map.slope * mu + options_.map.offset;
    return options_.map.clamp ? std::clamp(p, 0.0, 255.0) : p;
  }

  const BeamGrid& beams_;
  const CtVolume& ct_;
  CtVolume limited_;
  Eigen::Isometry3d T_ct_us_;
  const SimulationOptions& options_;
  SimulatedComponents& result_;
};

SimulatedComponents empty_components(const BeamGrid& beams) {
  SimulatedComponents result;
  result.samples = beams.samples();
  result.lines = beams.lines;
  result.frames = beams.frames;
  const std::size_t count = beams.beams.size() * static_cast<std::size_t>(beams.samples());
  for (std::vector<float>* image :
       {&result.ct_hu, &result.gradient_hu_per_mm, &result.reflection_coefficient,
        &result.transmission, &result.intensity, &result.reflection, &result.mapped_ct})
    image->resize(count);
  result.flags.resize(count);
  return result;
}

}  // namespace

int OcclusionOptions::echo_samples(double spacing_mm) const {
  return echo_mm ? static_cast<int>(std::ceil(*echo_mm / spacing_mm)) : 0;
}

void SimulationOptions::validate(const std::string& source) const {
  const auto finite = [&](const char* field, double value) {
    require(std::isfinite(value), source, field, value, "finite");
  };
  const auto positive = [&](const char* field, double value) {
    require(is_positive(value), source, field, value, "finite and > 0");
  };
  finite("outside_hu", outside_hu);
  if (window) window->validate(source);
  finite("hu_shift", hu_shift);
  positive("mu_floor", mu_floor);
  positive("gradient_length_mm", gradient_length_mm);
  if (transmission_length_mm) positive("transmission_length_mm", *transmission_length_mm);
  finite("gas_hu", occlusion.gas_hu);
  require(occlusion.bone_hu > occlusion.gas_hu, source, "bone_hu", occlusion.bone_hu, "> gas_hu");
  require(occlusion.gradient_hu_per_mm > 0.0, source, "gradient_hu_per_mm",
          occlusion.gradient_hu_per_mm, "> 0");
  if (occlusion.echo_mm)
    require(*occlusion.echo_mm > 0.0 && *occlusion.echo_mm <= kMostEchoMm, source, "echo_mm",
            *occlusion.echo_mm, "> 0 and <= 50, or none");
  positive("log_a", log_a);
  positive("reflection_scale", reflection_scale);
  finite("map.slope", map.slope);
  finite("map.offset", map.offset);
}

SimulatedComponents simulate_components(const BeamGrid& beams, const CtVolume& ct,
                                        const Eigen::Isometry3d& T_ct_us,
                                        const SimulationOptions& options,
                                        const Progress& progress) {
  beams.validate();
  ct.validate("CT");
  require_rigid(T_ct_us, "T_ct_us");
  options.validate();
  SimulatedComponents result = empty_components(beams);
  const BeamSimulator simulator(beams, ct, T_ct_us, options, result);
  parallel_for(
      beams.frames,
      [&](int frame) {
        for (int line = 0; line < beams.lines; ++line) simulator.simulate(line, frame);
      },
      progress);
  return result;
}

}  // namespace usct
