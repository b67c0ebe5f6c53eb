// These functions are apart from bytes.cpp, because the fuzzed parsers need them but open no files.
#include "io/bytes.h"
#include "us_ct_registration/error.h"

namespace usct::io {

std::uint64_t size_product(std::initializer_list<std::int64_t> factors, const std::string& source,
                           const std::string& field) {
  constexpr std::int64_t kLargest = std::int64_t{1} << 62;
  std::int64_t product = 1;
  for (const std::int64_t factor : factors) {
    if (factor < 1)
      throw InputError(source, "'" + field + "' is " + std::to_string(factor) + ", must be >= 1");
    if (product > kLargest / factor)
      throw InputError(source,
                       "'" + field + "' is too large: the sizes multiply to more than 2^62");
    product *= factor;
  }
  return static_cast<std::uint64_t>(product);
}

std::int32_t int32_le(const Bytes& bytes, std::size_t offset) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= static_cast<std::uint32_t>(bytes[offset + i]) << (8 * i);
  return static_cast<std::int32_t>(value);
}

void append_int32_le(Bytes& bytes, std::int32_t value) {
  const auto bits = static_cast<std::uint32_t>(value);
  for (unsigned shift = 0; shift < 32; shift += 8)
    bytes.push_back(static_cast<std::uint8_t>(bits >> shift));
}

}  // namespace usct::io
