#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>

#include "ultrasound/selection.h"

namespace usct::test {
namespace {

RC_GTEST_PROP(Selection, FindsWhatSortingFinds, ()) {
  // Of either sign, repeated, and of all magnitudes or of nearly the same one.
  const int octaves = *rc::gen::inRange(0, 30);
  const auto values = *rc::gen::nonEmpty(rc::gen::container<std::vector<float>>(rc::gen::map(
      rc::gen::pair(rc::gen::inRange(-1000, 1000), rc::gen::inRange(-octaves, octaves + 1)),
      [](const std::pair<int, int>& number) {
        return std::ldexp(static_cast<float>(number.first), number.second);
      })));
  std::vector<float> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t n = 0; n < sorted.size(); ++n) {
    std::vector<float> spoilt = values;
    RC_ASSERT(nth_value(spoilt, n) == sorted[n]);
  }
}

}  // namespace
}  // namespace usct::test
