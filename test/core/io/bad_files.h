#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "core/io/without_permission.h"

namespace usct::test {

using FileBytes = std::vector<std::uint8_t>;

inline FileBytes to_bytes(const std::string& text) { return {text.begin(), text.end()}; }

inline FileBytes slurp(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline std::filesystem::path spit(const std::filesystem::path& path, const FileBytes& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  return path;
}

inline std::filesystem::path spit(const std::filesystem::path& path, const std::string& text) {
  return spit(path, to_bytes(text));
}

inline void append_int32(FileBytes& bytes, std::int32_t value) {
  for (int shift = 0; shift < 32; shift += 8)
    bytes.push_back(static_cast<std::uint8_t>(static_cast<std::uint32_t>(value) >> shift));
}

/// Expects the reader to refuse, with a message: a missing file, a folder, an empty file, a file
/// without permission, foreign content, and the good file cut off at many places.
inline void expect_refuses_broken_files(
    const std::function<void(const std::filesystem::path&)>& read, const FileBytes& good,
    const std::string& extension) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / ("file" + extension);
  expect_input_error([&] { read(path); }, {path.string(), "does not exist"});
  std::filesystem::create_directory(path);
  expect_input_error([&] { read(path); }, {path.string(), "is a folder"});
  std::filesystem::remove(path);
  spit(path, FileBytes());
  expect_input_error([&] { read(path); }, {path.string(), "is empty"});
  spit(path, good);
  EXPECT_NO_THROW(read(path));
  {
    const WithoutPermission lock(path);
    expect_input_error([&] { read(path); }, {path.string(), "cannot be opened"});
  }
  spit(path, "GIF89a\x01\x02 something else altogether\n\n");
  expect_input_error([&] { read(path); }, {path.string()});
  for (std::size_t size = 1; size < good.size(); size += 1 + size / 16) {
    spit(path, FileBytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)));
    SCOPED_TRACE("cut off after " + std::to_string(size) + " bytes");
    expect_input_error([&] { read(path); }, {path.string()});
  }
}

}  // namespace usct::test
