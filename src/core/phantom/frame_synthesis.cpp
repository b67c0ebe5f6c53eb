#include "phantom/frame_synthesis.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "random.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom {
namespace {

using Eigen::Isometry3f;
using Eigen::Vector3f;

constexpr float kReach = 2.7F;  // standard deviations of the point spread
constexpr int kFractions = 64;
// Level of a perfect plane mirror across the beam, relative to the speckle of renal cortex. The
// border of fat and kidney (7 % reflection) is then 15 to 20 dB above the speckle, as in real
// images.
constexpr float kMirrorLevel = 900.0F;
// Diffuse share and narrowness of the reflection of tissue interfaces.
constexpr float kDiffuse = 0.06F;
constexpr int kDirectivityPower = 14;
constexpr float kSideLobe = 0.03F;
constexpr float kSideLobeWiden = 3.2F;
// Echoes below this level (cortex = 1) are neglected.
constexpr float kFaint = 1e-4F;
constexpr float kNothingLeft = 3e-6F;

/// Tables of phasors and Gaussians; 4096 entries per turn give an error of -60 dB.
struct Tables {
  static constexpr int kTurn = 4096;
  static constexpr int kGauss = 2048;
  std::array<float, kTurn> cosine, sine;
  std::array<float, kGauss + 1> gauss;  // exp(-u), u in [0, kReach^2 / 2]
  Tables() {
    for (int i = 0; i < kTurn; ++i) {
      const double angle = 2.0 * kPi * (i + 0.5) / kTurn;
      cosine[static_cast<std::size_t>(i)] = static_cast<float>(std::cos(angle));
      sine[static_cast<std::size_t>(i)] = static_cast<float>(std::sin(angle));
    }
    for (int i = 0; i <= kGauss; ++i)
      gauss[static_cast<std::size_t>(i)] =
          std::exp(-(static_cast<float>(i) + 0.5F) / kGauss * 0.5F * kReach * kReach);
  }
  float gaussian(float half_square) const {
    return gauss[static_cast<std::size_t>(half_square * (kGauss / (0.5F * kReach * kReach)))];
  }
};
const Tables& tables() {
  static const Tables instance;
  return instance;
}

std::vector<double> positions_of(const Array& array) {
  if (const auto* linear = std::get_if<LinearArray>(&array)) return linear->line_positions_mm;
  return std::get<CurvilinearArray>(array).line_angles_rad;
}

bool is_even(const std::vector<double>& table) {
  const double step = (table.back() - table.front()) / static_cast<double>(table.size() - 1);
  for (std::size_t i = 0; i < table.size(); ++i)
    if (std::abs(table[i] - table.front() - static_cast<double>(i) * step) > 1e-3 * std::abs(step))
      return false;
  return true;
}

float power(float x, int n) {
  float result = 1.0F;
  for (; n > 0; n >>= 1, x *= x)
    if (n & 1) result *= x;
  return result;
}

/// std::floor without the call that baseline x86-64 makes of it; for |x| < 2^20.
int floor_of(float x) {
  const int truncated = static_cast<int>(x);
  return truncated - (static_cast<float>(truncated) > x ? 1 : 0);
}

float unit_from(std::uint32_t h) { return static_cast<float>(uniform(mix(h))); }

}  // namespace

/// The signal of a frame, with padding before and after each line for parts of pulses.
struct FrameSynthesis::Signal {
  Signal(int lines, int samples_in, int pad_in)
      : samples(samples_in),
        pad(pad_in),
        stride(samples_in + 2 * pad_in),
        re(static_cast<std::size_t>(lines) * static_cast<std::size_t>(stride), 0.0F),
        im(re) {}
  std::size_t start(int line, int sample) const {
    return static_cast<std::size_t>(line) * static_cast<std::size_t>(stride) +
           static_cast<std::size_t>(pad + sample);
  }
  int samples, pad, stride;
  std::vector<float> re, im;
};

FrameSynthesis::FrameSynthesis(const ScattererField& field, const BeamProfile& profile,
                               const UltrasoundOptions& options, const ScanGeometry& geometry)
    : field_(field),
      profile_(profile),
      options_(options),
      geometry_(geometry),
      curved_(std::holds_alternative<CurvilinearArray>(geometry.array)),
      line_table_(positions_of(geometry.array), "array", "lines"),
      evenly_spaced_(is_even(positions_of(geometry.array))) {
  for (const double p : positions_of(geometry.array))
    line_positions_.push_back(static_cast<float>(p));
  line_tilts_rad_.assign(line_positions_.size(), 0.0F);
  if (curved_)
    array_radius_mm_ =
        static_cast<float>(std::get<CurvilinearArray>(geometry.array).probe_radius_mm);
  if (const auto* motor = std::get_if<MotorSweep>(&geometry.motion)) {
    axis_offset_mm_ = array_radius_mm_ - static_cast<float>(motor->motor_radius_mm);
    for (int l = 0; l < geometry.lines(); ++l) {
      const double tilt =
          motor_angle_rad(*motor, geometry.lines(), 0, l) - motor->frame_angles_rad.front();
      line_tilts_rad_[static_cast<std::size_t>(l)] = static_cast<float>(tilt);
      largest_tilt_rad_ = std::max(largest_tilt_rad_, static_cast<float>(std::abs(tilt)));
    }
  }
  const double sigma = profile.axial_sigma_mm() / geometry.axial.spacing_mm;
  taps_ = 2 * std::max(1, static_cast<int>(std::ceil(static_cast<double>(kReach) * sigma)));
  for (int f = 0; f < kFractions; ++f)
    for (int t = 0; t < taps_; ++t) {
      const int whole = t - (taps_ / 2 - 1);
      const double offset = whole - (f + 0.5) / kFractions;
      tap_table_.push_back(static_cast<float>(std::exp(-0.5 * offset * offset / (sigma * sigma))));
    }
}

FrameSynthesis::Place FrameSynthesis::place_of(const Vector3f& p) const {
  Place place{};
  place.y_mm = p.y();
  place.z_mm = p.z();
  if (curved_) {
    place.along = std::atan2(p.x(), p.y());
    place.radius_mm = std::sqrt(p.x() * p.x() + p.y() * p.y());
    place.depth_mm = place.radius_mm - array_radius_mm_;
  } else {
    place.along = p.x();
    place.depth_mm = p.y();
  }
  if (evenly_spaced_)
    place.line = (place.along - line_positions_.front()) /
                 (line_positions_.back() - line_positions_.front()) *
                 static_cast<float>(line_positions_.size() - 1);
  else
    place.line = static_cast<float>(line_table_.index_of(static_cast<double>(place.along)));
  return place;
}

float FrameSynthesis::depth_of(const Vector3f& p) const {
  return curved_ ? std::sqrt(p.x() * p.x() + p.y() * p.y()) - array_radius_mm_ : p.y();
}

void FrameSynthesis::add_echo(const Place& place, const BeamWidth& width, const Echo& echo,
                              Signal& signal) const {
  const Tables& table = tables();
  const float sigma = width.lateral_sigma_mm * echo.widen;
  const float mm_per_unit = curved_ ? place.radius_mm : 1.0F;
  const float reach = kReach * sigma / mm_per_unit;  // in angles, or mm
  const int count = static_cast<int>(line_positions_.size());
  const int first_guess = static_cast<int>(place.line);
  const float bend = 0.25F * width.lateral_curvature - (curved_ ? 0.5F / place.radius_mm : 0.0F);
  const float turns_per_mm = static_cast<float>(2.0 / profile_.wavelength_mm());
  const float lateral_scale = 0.5F / (sigma * sigma);
  const float elevation_scale = 0.5F / (width.elevation_sigma_mm * width.elevation_sigma_mm);
  const float limit = 0.5F * kReach * kReach;
  const auto scale = static_cast<float>(1.0 + options_.sound_speed_error);
  const auto start = static_cast<float>(geometry_.axial.start_depth_mm);
  const auto per_mm = static_cast<float>(1.0 / geometry_.axial.spacing_mm);
  const float lever_mm = place.y_mm - axis_offset_mm_;

  const auto add_line = [&](int l) {
    const auto n = static_cast<std::size_t>(l);
    const float x = (place.along - line_positions_[n]) * mm_per_unit;
    const float z = place.z_mm - lever_mm * line_tilts_rad_[n];
    const float spread = x * x * lateral_scale + z * z * elevation_scale;
    if (spread >= limit) return;
    const float range = place.depth_mm + echo.extra_range_mm + x * x * bend +
                        0.25F * z * z * width.elevation_curvature;
    const float sample = (range * scale - start) * per_mm;
    const int whole = floor_of(sample);
    const int i = whole - (taps_ / 2 - 1);
    if (i < -signal.pad || i + taps_ > signal.samples + signal.pad) return;
    const float turn = range * turns_per_mm + echo.turn;
    const auto phase =
        static_cast<std::size_t>((turn - static_cast<float>(floor_of(turn))) * Tables::kTurn) &
        (Tables::kTurn - 1);
    const float amplitude = echo.amplitude * table.gaussian(spread);
    const float re = amplitude * table.cosine[phase];
    const float im = -amplitude * table.sine[phase];
    // A sample just below 0 has a fraction that rounds to 1.
    const int fraction = std::min(
        kFractions - 1, static_cast<int>((sample - static_cast<float>(whole)) * kFractions));
    const float* taps = tap_table_.data() + fraction * taps_;
    float* to_re = &signal.re[signal.start(l, i)];
    float* to_im = &signal.im[signal.start(l, i)];
    for (int t = 0; t < taps_; ++t) {
      to_re[t] += re * taps[t];
      to_im[t] += im * taps[t];
    }
  };
  const auto beyond = [&](int l) {
    return std::abs(place.along - line_positions_[static_cast<std::size_t>(l)]) > reach;
  };
  for (int l = std::clamp(first_guess, -1, count - 1); l >= 0; --l) {
    if (l <= first_guess && beyond(l)) break;
    add_line(l);
  }
  for (int l = std::clamp(first_guess, -1, count - 1) + 1; l < count; ++l) {
    if (l > first_guess && beyond(l)) break;
    add_line(l);
  }
}

void FrameSynthesis::add_volume(const Scatterer& scatterer, const Isometry3f& T_frame_probe,
                                const TransmissionMap& transmission, Signal& signal) const {
  const Vector3f p = T_frame_probe * scatterer.p_mm;
  const float depth = depth_of(p);
  if (depth < 0.0F) return;
  const BeamWidth& width = profile_.at(depth);
  if (std::abs(p.z()) > kReach * width.elevation_sigma_mm + largest_tilt_rad_ * (depth + 60.0F))
    return;
  const Place place = place_of(p);
  if (place.line < -8.0F || place.line > static_cast<float>(line_positions_.size()) + 7.0F) return;
  const TransmissionMap::Value left = transmission.at(place.line, depth);
  if (left.level < kNothingLeft) return;
  const float amplitude = scatterer.amplitude * width.speckle_scale * left.level;
  add_echo(place, width, {amplitude, left.delay_mm, 0.0F, 1.0F}, signal);
}

void FrameSynthesis::add_surface(const SurfaceScatterer& scatterer, const Isometry3f& T_frame_probe,
                                 const TransmissionMap& transmission, Signal& signal) const {
  const Vector3f p = T_frame_probe * scatterer.p_mm;
  const Place place = place_of(p);
  if (place.depth_mm < 0.0F) return;
  const BeamWidth& width = profile_.at(place.depth_mm);
  if (std::abs(p.z()) >
      kReach * width.elevation_sigma_mm + largest_tilt_rad_ * (place.depth_mm + 60.0F))
    return;
  if (place.line < -12.0F || place.line > static_cast<float>(line_positions_.size()) + 11.0F)
    return;
  // The sound is taken just above the interface, because the map is too coarse to separate its
  // sides.
  const float above_mm = scatterer.is_strong ? 1.6F : 0.4F;
  const TransmissionMap::Value left =
      transmission.at(place.line, std::max(0.0F, place.depth_mm - above_mm));
  const auto specular = static_cast<float>(options_.specular);
  float amplitude = scatterer.amplitude * left.level;
  if (scatterer.ball_radius_mm == 0.0F) {
    const Vector3f normal = T_frame_probe.linear() * scatterer.normal;
    const Vector3f beam = curved_ ? Vector3f(std::sin(place.along), std::cos(place.along), 0.0F)
                                  : Vector3f(0.0F, 1.0F, 0.0F);
    const float directivity =
        kDiffuse + (1.0F - kDiffuse) * power(std::abs(normal.dot(beam)), kDirectivityPower);
    amplitude *= specular * kMirrorLevel * width.plane_scale * directivity;
  }
  if (amplitude < kFaint) return;
  const Echo first{amplitude, left.delay_mm - scatterer.ball_radius_mm, 0.0F, 1.0F};
  add_echo(place, width, first, signal);
  if (scatterer.is_strong) {
    Echo lobe = first;
    lobe.amplitude *= kSideLobe;
    lobe.widen = kSideLobeWiden;
    add_echo(place, width, lobe, signal);
  }
  add_ringing(scatterer, place, width, first, signal);
}

void FrameSynthesis::add_ringing(const SurfaceScatterer& scatterer, const Place& place,
                                 const BeamWidth& width, const Echo& first, Signal& signal) const {
  const auto strength = static_cast<float>(options_.reverberation);
  if (strength == 0.0F) return;
  // The echo travels a second time between interface and array, and appears as a ghost at twice the
  // depth.
  Echo ghost = first;
  ghost.extra_range_mm += place.depth_mm;
  ghost.amplitude *= strength * (scatterer.is_gas ? 0.07F : 0.03F);
  ghost.widen = 1.5F;
  if (ghost.amplitude > kFaint && scatterer.ball_radius_mm == 0.0F)
    add_echo(place, width, ghost, signal);
  // Sound that bounces between bubbles of foam, or within a steel ball, returns as a train of
  // echoes.
  const bool steel_ball = scatterer.ball_radius_mm > 0.0F && !scatterer.is_gas;
  if (!scatterer.is_gas && !steel_ball) return;
  const float interval_mm = steel_ball ? 0.9F : 0.8F + 1.5F * unit_from(scatterer.hash);
  const float decay = steel_ball ? 0.45F : 0.80F + 0.08F * unit_from(scatterer.hash + 1U);
  Echo train = first;
  train.amplitude *= strength * (steel_ball ? 0.4F : 0.16F);
  for (std::uint32_t m = 1; m < 40 && train.amplitude > 30.0F * kFaint; ++m) {
    train.extra_range_mm += interval_mm;
    train.turn = unit_from(scatterer.hash + 17U * m);
    train.widen = std::min(2.0F, train.widen * 1.03F);
    add_echo(place, width, train, signal);
    train.amplitude *= decay;
  }
}

bool FrameSynthesis::block_in_reach(const ScattererField::Block& block,
                                    const Isometry3f& T_frame_probe) const {
  const Vector3f p = T_frame_probe * block.centre_mm;
  const float depth = depth_of(p);
  const float near = std::max(0.0F, depth - block.radius_mm);
  const float far = std::max(0.0F, depth + block.radius_mm);
  const float widest =
      std::max({profile_.at(near).elevation_sigma_mm, profile_.at(far).elevation_sigma_mm,
                profile_.at(std::max(0.0F, depth)).elevation_sigma_mm});
  return far > 0.0F &&
         std::abs(p.z()) < block.radius_mm + kReach * widest + largest_tilt_rad_ * (far + 60.0F);
}

std::vector<std::complex<float>> FrameSynthesis::echoes(const Isometry3f& T_frame_probe,
                                                        const TransmissionMap& transmission) const {
  Signal signal(geometry_.lines(), geometry_.samples(), taps_);
  for (const ScattererField::Block& block : field_.blocks) {
    if (!block_in_reach(block, T_frame_probe)) continue;
    for (const Scatterer& s : block.volume) add_volume(s, T_frame_probe, transmission, signal);
    for (const SurfaceScatterer& s : block.surface)
      add_surface(s, T_frame_probe, transmission, signal);
  }
  std::vector<std::complex<float>> result;
  result.reserve(static_cast<std::size_t>(geometry_.lines()) *
                 static_cast<std::size_t>(geometry_.samples()));
  for (int l = 0; l < geometry_.lines(); ++l)
    for (int i = 0; i < geometry_.samples(); ++i)
      result.emplace_back(signal.re[signal.start(l, i)], signal.im[signal.start(l, i)]);
  return result;
}

}  // namespace usct::phantom
