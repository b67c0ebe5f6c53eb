#include "phantom/receiver.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "order_statistics.h"
#include "random.h"

namespace usct::phantom {
namespace {

constexpr double kSoftTissueDbCmMhz = 0.5;
constexpr int kSliders = 8;
// The operator sets the TGC by the bright tissue at a depth, not by shadows.
constexpr double kTgcPercentile = 0.62;
// The operator raises the gain at most until noise has this level, relative to cortex.
constexpr double kBrightestNoiseDb = -9.0;
constexpr double kRingDownMm = 3.0;
constexpr double kNoContactRingDownMm = 14.0;

float amplitude(double db) { return static_cast<float>(std::pow(10.0, db / 20.0)); }

std::complex<float> noise_at(std::uint64_t seed, int a, int b, int c) {
  const std::complex<double> z = normal_pair(hash(seed, a, b, c));
  return {static_cast<float>(z.real() * 0.70710678), static_cast<float>(z.imag() * 0.70710678)};
}

/// The level that a share of all points at a depth does not exceed, per depth node.
std::vector<double> typical_level_db(const std::vector<TransmissionMap>& maps) {
  std::vector<double> typical;
  std::vector<float> levels;
  for (int j = 0; j < maps.front().depths; ++j) {
    levels.clear();
    for (const TransmissionMap& map : maps)
      for (int i = 0; i < map.lines; ++i) levels.push_back(map.level[map.offset(i, j)]);
    const auto rank = kTgcPercentile * static_cast<double>(levels.size() - 1);
    const float level = value_of_rank(levels, static_cast<std::size_t>(rank));
    typical.push_back(20.0 * std::log10(std::max(1e-9, static_cast<double>(level))));
  }
  return typical;
}

/// Mean over a window along lines and samples; at the edges, over the part of the window that
/// exists.
std::vector<float> box_mean(const std::vector<float>& in, int lines, int samples, int half_lines,
                            int half_samples) {
  std::vector<float> along(in.size());
  std::vector<float> out(in.size());
  const auto slide = [](const float* from, float* to, int count, std::ptrdiff_t stride, int half) {
    double sum = 0.0;
    int inside = 0;
    for (int i = 0; i < std::min(half, count); ++i) {
      sum += static_cast<double>(from[i * stride]);
      ++inside;
    }
    for (int i = 0; i < count; ++i) {
      if (i + half < count) {
        sum += static_cast<double>(from[(i + half) * stride]);
        ++inside;
      }
      if (i - half - 1 >= 0) {
        sum -= static_cast<double>(from[(i - half - 1) * stride]);
        --inside;
      }
      to[i * stride] = static_cast<float>(sum / inside);
    }
  };
  for (int l = 0; l < lines; ++l) {
    const std::size_t start = static_cast<std::size_t>(l) * static_cast<std::size_t>(samples);
    slide(&in[start], &along[start], samples, 1, half_samples);
  }
  for (int s = 0; s < samples; ++s)
    slide(&along[static_cast<std::size_t>(s)], &out[static_cast<std::size_t>(s)], lines, samples,
          half_lines);
  return out;
}

}  // namespace

Receiver::Receiver(const UltrasoundOptions& options, double frequency_mhz,
                   const ScanGeometry& geometry, const std::vector<TransmissionMap>& transmissions,
                   std::uint64_t seed)
    : options_(options),
      seed_(hash(seed, 0x4EC)),
      lines_(geometry.lines()),
      samples_(geometry.samples()),
      spacing_mm_(geometry.axial.spacing_mm) {
  const double noise_db = -0.2 * kSoftTissueDbCmMhz * frequency_mhz * options.penetration_mm;
  noise_level_ = amplitude(noise_db);
  Sequence random(seed, 0x76C);
  no_contact_at_end_ = random.next() % 2 == 0;

  std::array<double, kSliders> slider_db{};
  const std::vector<double> typical = typical_level_db(transmissions);
  const double deepest = geometry.axial.depth_mm(samples_ - 1);
  for (int i = 0; i < kSliders; ++i) {
    const double depth = deepest * i / (kSliders - 1);
    const auto node = std::min(typical.size() - 1,
                               static_cast<std::size_t>(depth / TransmissionMap::kDepthStepMm));
    const double error_db = random.gaussian(0.0, options.tgc_error_db);
    slider_db[static_cast<std::size_t>(i)] =
        std::min(-typical[node], kBrightestNoiseDb - noise_db) + error_db;
  }
  for (int s = 0; s < samples_; ++s) {
    const double x = std::clamp(geometry.axial.depth_mm(s) / deepest, 0.0, 1.0) * (kSliders - 1);
    const int i = std::min(kSliders - 2, static_cast<int>(x));
    const double low = slider_db[static_cast<std::size_t>(i)];
    const double high = slider_db[static_cast<std::size_t>(i) + 1];
    tgc_db_.push_back(options.time_gain_compensation ? low + (x - i) * (high - low) : 0.0);
  }
  for (int l = 0; l < lines_; ++l)
    for (int s = 0; s < samples_; ++s) {
      const double depth = geometry.axial.depth_mm(s);
      const float level =
          amplitude(options.near_field_db) * static_cast<float>(std::exp(-depth / kRingDownMm));
      ring_down_.push_back(level * (noise_at(seed_, s, -1, 0) + 0.5F * noise_at(seed_, s, l, 1)));
    }
}

double Receiver::line_gain_error_db(int frame, int line) const {
  const double lateral = smooth_noise(hash(seed_, 1), {line / 14.0, frame / 40.0, 0.0});
  const double over_time = smooth_noise(hash(seed_, 2), {frame / 5.0, 0.0, 0.0});
  const double from_middle = std::abs(2.0 * line / (lines_ - 1) - 1.0);
  return options_.lateral_gain_error_db * lateral + options_.frame_gain_error_db * over_time -
         options_.edge_loss_db * std::pow(from_middle, 5.0);
}

int Receiver::lines_without_contact(int frame) const {
  if (options_.no_contact_lines == 0) return 0;
  const double wander = 1.0 + 0.25 * smooth_noise(hash(seed_, 3), {frame / 8.0, 0.0, 0.0});
  return std::clamp(static_cast<int>(options_.no_contact_lines * wander), 0, lines_);
}

void Receiver::add_haze(std::vector<std::complex<float>>& signal, int frame) const {
  const float level = amplitude(options_.clutter_db);
  if (level < 1e-5F) return;
  std::vector<float> energy(signal.size());
  for (std::size_t i = 0; i < signal.size(); ++i) energy[i] = std::norm(signal[i]);
  const int half_samples = std::max(1, static_cast<int>(5.0 / spacing_mm_));
  const int half_lines = std::max(2, lines_ / 10);
  energy = box_mean(box_mean(energy, lines_, samples_, half_lines, half_samples), lines_, samples_,
                    half_lines, half_samples);
  // Haze changes slowly from frame to frame.
  constexpr int kFramesPerKey = 4;
  const int key = frame / kFramesPerKey;
  const float turn = 1.5707963F * static_cast<float>(frame % kFramesPerKey) / kFramesPerKey;
  const std::uint64_t stream = hash(seed_, 4);
  for (int l = 0; l < lines_; ++l)
    for (int s = 0; s < samples_; ++s) {
      const std::size_t n = offset(l, s);
      const std::complex<float> z = std::cos(turn) * noise_at(stream, key, l, s) +
                                    std::sin(turn) * noise_at(stream, key + 1, l, s);
      signal[n] += level * std::sqrt(energy[n]) * z;
    }
}

std::vector<float> Receiver::envelope(std::vector<std::complex<float>> signal, int frame) const {
  const int dead = lines_without_contact(frame);
  for (int l = 0; l < lines_; ++l) {
    const bool contact = no_contact_at_end_ ? l < lines_ - dead : l >= dead;
    const double line_gain_db = line_gain_error_db(frame, l);
    for (int s = 0; s < samples_; ++s) {
      const std::size_t n = offset(l, s);
      std::complex<float>& z = signal[n];
      if (!contact) {
        // Such a line shows only the ring-down of the array, which no tissue damps.
        const double depth = s * spacing_mm_;
        z = amplitude(options_.near_field_db) *
            static_cast<float>(std::exp(-depth / kNoContactRingDownMm)) * noise_at(seed_, s, -1, 0);
      }
      z += ring_down_[n] + noise_level_ * noise_at(hash(seed_, 5), frame, l, s);
      z *= amplitude(tgc_db_[static_cast<std::size_t>(s)] + line_gain_db);
    }
  }
  add_haze(signal, frame);
  std::vector<float> envelope;
  envelope.reserve(signal.size());
  for (const std::complex<float>& z : signal) envelope.push_back(std::abs(z));
  return envelope;
}

std::vector<std::uint8_t> compress(const std::vector<float>& envelope,
                                   const UltrasoundOptions& options) {
  std::vector<std::uint8_t> grey;
  grey.reserve(envelope.size());
  const double per_db = 255.0 / options.dynamic_range_db;
  for (const float level : envelope) {
    const double db = 20.0 * std::log10(static_cast<double>(level) + 1e-12);
    grey.push_back(static_cast<std::uint8_t>(
        std::nearbyint(std::clamp(options.cortex_grey + per_db * db, 0.0, 255.0))));
  }
  return grey;
}

}  // namespace usct::phantom
