#pragma once

#include <string>
#include <type_traits>

#include "text.h"

/// Words and paths of keys in files of options.
namespace usct::io {

inline constexpr const char* kUnset = "none";
inline constexpr const char* kInfinite = ".inf";

template <typename T>
constexpr bool is_single = std::is_arithmetic_v<T> || std::is_enum_v<T>;

inline std::string path_of_entry(const std::string& path, std::size_t index) {
  return path + "[" + std::to_string(index) + "]";
}

}  // namespace usct::io
