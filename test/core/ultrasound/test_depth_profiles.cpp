#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/geometry/random_geometry.h"
#include "ultrasound/depth_profiles.h"
#include "ultrasound/nth_value.h"
#include "with_threads.h"

namespace usct::test {
namespace {

/// Values of which many are equal, with an outlier that leaves nearly all of them to one bin.
std::vector<float> random_values(std::size_t count) {
  const int distinct = integer(1, 2000);
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i)
    values[i] =
        static_cast<float>((i * 7919 + 13) % 10007 % static_cast<std::size_t>(distinct)) - 40.0F;
  if (*rc::gen::arbitrary<bool>())
    values[static_cast<std::size_t>(integer(0, static_cast<int>(count)))] = 1e30F;
  return values;
}

RC_GTEST_PROP(NthValue, IsThatOfSortedValues, ()) {
  const std::vector<float> values = random_values(static_cast<std::size_t>(integer(1, 3000)));
  std::vector<float> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  for (const std::size_t n :
       {std::size_t{0}, values.size() / 2, values.size() * 9 / 10, values.size() - 1})
    RC_ASSERT(nth_value(values.data(), values.size(), n) == sorted[n]);
}

RC_GTEST_PROP(DepthProfiles, AreMeanAndMedianOfWhatIsKnownAtEachDepth, ()) {
  const auto samples = static_cast<std::size_t>(integer(1, 80));
  const auto beams = static_cast<std::size_t>(integer(1, 40));
  std::vector<float> values = random_values(samples * beams);
  std::vector<std::uint8_t> known;
  if (*rc::gen::arbitrary<bool>())
    for (std::size_t i = 0; i < values.size(); ++i) {
      known.push_back((i * 104729) % 97 < 50 ? 255 : 0);
      if (known[i] == 0) values[i] = 0.0F;
    }
  const DepthProfiles profiles = with_threads(
      integer(1, 4), [&] { return depth_profiles(values.data(), values.size(), known, samples); });
  for (std::size_t s = 0; s < samples; ++s) {
    std::vector<float> column;
    double sum = 0.0;
    for (std::size_t i = s; i < values.size(); i += samples)
      if (known.empty() || known[i] != 0) {
        column.push_back(values[i]);
        sum += values[i];
      }
    if (column.empty()) {
      RC_ASSERT((std::isnan(profiles.mean[s]) && std::isnan(profiles.median[s])));
      continue;
    }
    std::sort(column.begin(), column.end());
    RC_ASSERT(profiles.mean[s] == sum / static_cast<double>(column.size()));
    RC_ASSERT(profiles.median[s] == static_cast<double>(column[column.size() / 2]));
  }
}

}  // namespace
}  // namespace usct::test
