#include "similarity/sampled_ultrasound.h"

#include <cmath>
#include <limits>

namespace usct {

std::vector<float> ultrasound_of(const UltrasoundPatches& us) {
  std::vector<float> values(us.value.size(), std::numeric_limits<float>::quiet_NaN());
  for (const UltrasoundPatches::Patch& patch : us.patches) {
    for (std::size_t i = 0; i < patch.strands(); ++i) {
      const std::size_t strand = patch.first_strand + i;
      const std::size_t rows = patch.rows_of(i);
      for (std::size_t row = 0; row < rows; ++row) {
        const std::size_t place = us.blocks[strand / kLanes].begin + row * kLanes + strand % kLanes;
        values[place] = static_cast<float>(us.value[place] + patch.mean);
      }
    }
  }
  return values;
}

CentredUltrasound::CentredUltrasound(const UltrasoundPatches& us) : value(ultrasound_of(us)) {
  const auto mean = static_cast<float>(mean_of(us));
  for (float& u : value) {
    u -= mean;
    if (!std::isnan(u)) square_sum += static_cast<double>(u) * u;
  }
}

}  // namespace usct
