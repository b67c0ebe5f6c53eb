#include "ultrasound/selection.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

namespace usct {
namespace {

constexpr std::uint32_t kLeadingBits = 12;  // sign, exponent, eighths of an octave

/// The leading bits of a number, in the order of numbers.
std::size_t leading_bits(float value) {
  constexpr std::uint32_t kSign = 0x80000000U;
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof(bits));
  bits ^= (bits & kSign) != 0 ? ~0U : kSign;
  return bits >> (32U - kLeadingBits);
}

}  // namespace

float nth_value(std::vector<float>& values, std::size_t n) {
  std::array<std::uint32_t, std::size_t{1} << kLeadingBits> count{};
  for (const float value : values) ++count[leading_bits(value)];
  std::size_t bits = 0;
  for (; n >= count[bits]; ++bits) n -= count[bits];
  // Few share their leading bits with it: the selection is among these alone.
  std::size_t sharing = 0;
  for (const float value : values) {
    values[sharing] = value;
    sharing += leading_bits(value) == bits ? 1 : 0;
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(n);
  std::nth_element(values.begin(), middle, values.begin() + static_cast<std::ptrdiff_t>(sharing));
  return *middle;
}

}  // namespace usct
