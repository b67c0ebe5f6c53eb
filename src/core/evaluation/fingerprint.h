#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "random.h"
#include "us_ct_registration/formatted.h"

namespace usct {

/// A hash of a sequence of values, the same on every machine of this byte order. It tells contents
/// apart that differ by chance or by mistake; it is no protection against intent.
class Fingerprint {
 public:
  void add(std::uint64_t value) { hash_ = hash(hash_, value); }
  void add(double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof(bits));
    add(bits);
  }
  /// Texts are followed by their lengths, so that "ab", "c" differs from "a", "bc".
  void add(std::string_view text) { add_bytes(text.data(), text.size()); }
  template <typename T>
  void add(const std::vector<T>& values) {
    static_assert(std::is_arithmetic_v<T>);
    add_bytes(values.data(), values.size() * sizeof(T));
  }
  /// 16 hexadecimal digits.
  std::string text() const { return formatted("%016llx", static_cast<unsigned long long>(hash_)); }

 private:
  void add_bytes(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t begin = 0; begin < size; begin += sizeof(std::uint64_t)) {
      std::uint64_t word = 0;
      std::memcpy(&word, bytes + begin, std::min(sizeof(word), size - begin));
      add(word);
    }
    add(static_cast<std::uint64_t>(size));
  }

  std::uint64_t hash_ = 0;
};

}  // namespace usct
