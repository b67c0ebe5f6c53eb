#include "ultrasound/frames_in_air.h"

#include <numeric>

#include "order_statistics.h"
#include "parallel.h"

namespace usct {
namespace {

constexpr double kAirShare = 0.2;
constexpr double kBrightQuantile = 0.9;
constexpr int kLineStep = 4;  // lines beside each other show the same

/// Mean of the known samples beyond the first quarter of the depth; 0 if there is none.
double brightness_of(const BeamUltrasound& us, int frame) {
  const auto samples = static_cast<std::size_t>(us.beams.samples());
  double sum = 0.0;
  std::size_t count = 0;
  for (int line = 0; line < us.beams.lines; line += kLineStep) {
    const std::size_t start = us.beams.offset(frame, line);
    for (std::size_t i = start + samples / 4; i < start + samples; ++i) {
      if (!us.known.empty() && us.known[i] == 0) continue;
      sum += us.brightness[i];
      ++count;
    }
  }
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

}  // namespace

std::vector<std::uint8_t> frames_in_air(const BeamUltrasound& ultrasound) {
  std::vector<double> brightness(static_cast<std::size_t>(ultrasound.beams.frames));
  parallel_for(ultrasound.beams.frames, [&](int frame) {
    brightness[static_cast<std::size_t>(frame)] = brightness_of(ultrasound, frame);
  });
  const auto rank = kBrightQuantile * static_cast<double>(brightness.size() - 1);
  const double bright = value_of_rank(brightness, static_cast<std::size_t>(rank));
  std::vector<std::uint8_t> air;
  for (const double one : brightness)
    air.push_back(bright > 0.0 && one < kAirShare * bright ? 1 : 0);
  const bool is_usual = 2 * std::accumulate(air.begin(), air.end(), std::size_t{0}) > air.size();
  return is_usual ? air : std::vector<std::uint8_t>{};
}

}  // namespace usct
