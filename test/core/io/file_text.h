#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace usct::test {

/// All bytes of a file; none if it cannot be opened.
inline std::string read_text(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Replaces the file.
inline void write_text(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

}  // namespace usct::test
