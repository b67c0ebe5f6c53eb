#include "ultrasound/depth_profiles.h"

#include <algorithm>
#include <limits>

#include "large_pages.h"
#include "parallel.h"
#include "ultrasound/nth_value.h"

namespace usct {

DepthProfiles depth_profiles(const float* values, std::size_t count,
                             const std::vector<std::uint8_t>& known, std::size_t samples) {
  constexpr std::size_t kAtOnce = 32;  // depths per task: about two cache lines of each beam
  const std::size_t beams = count / samples;
  DepthProfiles result{std::vector<double>(samples), std::vector<double>(samples)};
  const auto find = [&](std::size_t first, std::size_t last) {
    const std::size_t depths = last - first;
    LargeVector<float> columns(depths * beams);  // known values, depth by depth
    std::vector<std::size_t> counts(depths);
    std::vector<double> sums(depths);
    for (std::size_t beam = 0; beam < beams; ++beam)
      for (std::size_t i = 0, from = beam * samples + first; i < depths; ++i, ++from) {
        const bool is_known = known.empty() || known[from] != 0;
        sums[i] += is_known ? values[from] : 0.0F;
        columns[i * beams + counts[i]] = values[from];
        counts[i] += is_known ? 1 : 0;
      }
    for (std::size_t i = 0; i < depths; ++i) {
      result.mean[first + i] = sums[i] / static_cast<double>(counts[i]);
      result.median[first + i] = counts[i] == 0
                                     ? std::numeric_limits<double>::quiet_NaN()
                                     : nth_value(&columns[i * beams], counts[i], counts[i] / 2);
    }
  };
  parallel_ranges(samples, find, kAtOnce);
  return result;
}

}  // namespace usct
