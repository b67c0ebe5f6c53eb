#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <vector>

#include "core/similarity/instructions.h"
#include "rendering/structure_fill.h"

namespace usct {
namespace {

using rendering::fill_structure;
using rendering::StructureFill;

/// Each set of instructions fills rows of any length as the definition says, and touches no pixel
/// beyond them.
RC_GTEST_PROP(StructureFill, MixesTheColourByDepth, ()) {
  const auto count = *rc::gen::inRange<std::size_t>(0, 70);
  const auto number = [](int most) { return *rc::gen::inRange(0, most + 1); };
  const StructureFill fill{{static_cast<std::uint8_t>(number(255)), 40, 250},
                           number(100) / 100.0,
                           1.0 + number(300) / 10.0};
  constexpr std::size_t kBeyond = 40;
  std::vector<std::uint8_t> before(3 * (count + kBeyond));
  for (std::uint8_t& value : before) value = static_cast<std::uint8_t>(number(255));
  std::vector<float> inverse(count), first(count);
  std::size_t covered = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_covered = number(3) > 0;
    const double depth_mm = 20.0 + number(2000) / 10.0;
    covered += is_covered ? 1 : 0;
    inverse[i] = is_covered ? static_cast<float>(1.0 / depth_mm) : 0.0F;
    first[i] = number(1) == 0 ? inverse[i] : static_cast<float>(1.0 / (depth_mm - 15.0));
  }
  for (const std::int64_t target : test::Instructions::all()) {
    const test::Instructions chosen(target);
    std::vector<std::uint8_t> after = before;
    RC_ASSERT(fill_structure(after.data(), inverse.data(), first.data(), count, fill) == covered);
    for (std::size_t k = 0; k < after.size(); ++k) {
      const std::size_t i = k / 3;
      double weight = 0.0;
      if (i < count && inverse[i] > 0.0F) {
        const double behind_mm = 1.0 / double{inverse[i]} - 1.0 / double{first[i]};
        weight = fill.opacity * fill.hidden_depth_mm / (fill.hidden_depth_mm + behind_mm);
      }
      // The weight is cut to 1/256, and then the mixture to a whole grey level.
      const double expected = before[k] + weight * (fill.colour[k % 3] - before[k]);
      RC_ASSERT(std::abs(after[k] - expected) < (weight > 0.0 ? 2.01 : 0.01));
    }
  }
}

}  // namespace
}  // namespace usct
