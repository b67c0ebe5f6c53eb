#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "io/bytes.h"
#include "us_ct_registration/error.h"

/// The main program of the fuzz targets. A target defines two functions: `seeds`, a few good and
/// absurd files to start from, and `check`, which parses bytes and may throw InputError only.
///
/// The corpus folder is the last argument of the command line. It is replaced at the start, so that
/// every run is the same.
namespace usct::fuzz {

std::vector<io::Bytes> seeds();
void check(const io::Bytes& bytes);

/// Ends the run if a parsed result is wrong; sanitizers find crashes.
inline void require(bool condition) {
  if (!condition) std::abort();
}

/// Runs an action that must not refuse what the parser has accepted.
template <typename Action>
auto accepted(const Action& action) {
  try {
    return action();
  } catch (const InputError&) {
    std::abort();
  }
}

inline io::Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

}  // namespace usct::fuzz

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  const std::filesystem::path corpus = (*argv)[*argc - 1];
  std::filesystem::remove_all(corpus);
  std::filesystem::create_directories(corpus);
  int number = 0;
  for (const usct::io::Bytes& seed : usct::fuzz::seeds()) {
    std::ofstream file(corpus / ("seed" + std::to_string(number++)), std::ios::binary);
    file.write(reinterpret_cast<const char*>(seed.data()),
               static_cast<std::streamsize>(seed.size()));
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    usct::fuzz::check(usct::io::Bytes(data, data + size));
  } catch (const usct::InputError&) {
    // A refusal is right.
  }
  return 0;
}
