#include <algorithm>
#include <cmath>

#include "similarity/joint_sums.h"
#include "similarity/scalar_sampler.h"

namespace usct {

JointSums joint_sums_scalar(const JointSumsInput& in) {
  const auto columns = static_cast<std::size_t>(in.columns);
  const std::size_t knots = static_cast<std::size_t>(in.rows) * columns;
  JointSums sums{std::vector<double>(knots), std::vector<double>(knots), 0.0};
  const ScalarSampler sampler(in.samples);
  const PackedCt& packed = in.samples.ct;
  const auto scale = static_cast<float>(in.gradient_scale_hu_per_mm / packed.step_hu());
  for (std::size_t s = 0; s < in.samples.us.value.size(); ++s) {
    const float u = in.ultrasound[s];
    if (std::isnan(u)) continue;
    float value = static_cast<float>(packed.background());
    float gradient = 0.0F;
    ScalarSampler::Sampled ct;
    if (sampler.sample(s, ct)) {
      value = ct.value;
      gradient = ct.gradient.cwiseQuotient(packed.grid().spacing_mm.cast<float>()).norm();
      sums.inside += 1.0;
    }
    const float row = value * (static_cast<float>(in.rows - 1) / 255.0F);
    const float column = gradient / (gradient + scale) * static_cast<float>(in.columns - 1);
    const int r = std::min(static_cast<int>(row), in.rows - 2);
    const int c = std::min(static_cast<int>(column), in.columns - 2);
    for (int dr = 0; dr < 2; ++dr)
      for (int dc = 0; dc < 2; ++dc) {
        const float along_row = row - static_cast<float>(r);
        const float along_column = column - static_cast<float>(c);
        const double weight = static_cast<double>(dr == 0 ? 1.0F - along_row : along_row) *
                              static_cast<double>(dc == 0 ? 1.0F - along_column : along_column);
        const std::size_t knot =
            static_cast<std::size_t>(r + dr) * columns + static_cast<std::size_t>(c + dc);
        sums.ultrasound[knot] += weight * static_cast<double>(u);
        sums.count[knot] += weight;
      }
  }
  return sums;
}

}  // namespace usct
