#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "io/bytes.h"

namespace usct::fuzz {

/// Makes new files from known ones: changed bits and bytes, blocks that are left out, doubled,
/// moved or taken from another file, lengths, and, since most formats are text or have a text
/// header, numbers and words. The same seed gives the same files.
class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  /// A file that differs from one of `corpus`; at most kMostBytes long. Every other one is made
  /// from the first `seeds` of the corpus, which are good files; there must be at least one.
  io::Bytes mutated(const std::vector<io::Bytes>& corpus, std::size_t seeds);

  /// A number in [0, count), for decisions of the caller; count > 0.
  std::size_t below(std::size_t count);

  static constexpr std::size_t kMostBytes = 1 << 17;

 private:
  void change_bytes(io::Bytes& bytes);
  void change_blocks(io::Bytes& bytes, const std::vector<io::Bytes>& corpus);
  void change_number(io::Bytes& bytes);
  void change_words(io::Bytes& bytes);

  std::mt19937_64 random_;
};

}  // namespace usct::fuzz
