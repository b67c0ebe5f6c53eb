#pragma once

#include <stdexcept>
#include <string>

namespace usct::test {

/// The text with the first occurrence of `from` replaced. Throws if there is none, since the test
/// would then test nothing.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("test text has no " + from);
  return text.replace(at, from.size(), to);
}

}  // namespace usct::test
