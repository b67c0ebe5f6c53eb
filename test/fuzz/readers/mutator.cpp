#include "mutator.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

namespace usct::fuzz {
namespace {

using io::Bytes;

/// Numbers at which readers go wrong: limits of integers and of floating point, signs, and what is
/// no number.
constexpr std::array kNumbers = {"0",           "1",
                                 "-1",          "2",
                                 "3",           "255",
                                 "256",         "65535",
                                 "65536",       "32768",
                                 "-32769",      "2147483647",
                                 "2147483648",  "-2147483649",
                                 "4294967296",  "9223372036854775807",
                                 "1e9",         "18446744073709551616",
                                 "-0.0",        "0.1",
                                 "1e-300",      "1e308",
                                 "1e309",       "-1e309",
                                 "nan",         "inf",
                                 "-inf",        "0x10",
                                 "1,5",         "",
                                 "1e-7",        "0.30000000000000004",
                                 "99999999999", "-",
                                 "+1",          "1.5.2"};

/// Bytes at which binary headers go wrong.
constexpr std::array<std::uint8_t, 8> kBytes = {0x00, 0x01, 0x7f, 0x80, 0xff, 0xfe, 0x20, 0x0a};

bool is_in_number(std::uint8_t c) {
  return std::isdigit(c) != 0 || c == '.' || c == '-' || c == '+' || c == 'e';
}

std::ptrdiff_t at(std::size_t offset) { return static_cast<std::ptrdiff_t>(offset); }

/// The run of bytes around `offset` that fulfil the condition.
template <typename Condition>
std::pair<std::size_t, std::size_t> run_around(const Bytes& bytes, std::size_t offset,
                                               const Condition& condition) {
  std::size_t begin = offset;
  std::size_t end = offset;
  while (begin > 0 && condition(bytes[begin - 1])) --begin;
  while (end < bytes.size() && condition(bytes[end])) ++end;
  return {begin, end};
}

void replace(Bytes& bytes, std::size_t begin, std::size_t end, const Bytes& by) {
  bytes.erase(bytes.begin() + at(begin), bytes.begin() + at(end));
  bytes.insert(bytes.begin() + at(begin), by.begin(), by.end());
}

}  // namespace

std::size_t Mutator::below(std::size_t count) {
  return static_cast<std::size_t>(random_() % count);
}

void Mutator::change_bytes(Bytes& bytes) {
  const std::size_t offset = below(bytes.size());
  switch (below(4)) {
    case 0:
      bytes[offset] = static_cast<std::uint8_t>(bytes[offset] ^ (1U << below(8)));
      break;
    case 1:
      bytes[offset] = kBytes[below(kBytes.size())];
      break;
    case 2:
      bytes[offset] = static_cast<std::uint8_t>(random_());
      break;
    default:  // a whole little-endian number of 2, 4 or 8 bytes
      for (std::size_t i = offset, end = offset + (std::size_t{2} << below(3));
           i < std::min(end, bytes.size()); ++i)
        bytes[i] = kBytes[below(5)];
  }
}

void Mutator::change_blocks(Bytes& bytes, const std::vector<Bytes>& corpus) {
  const std::size_t begin = below(bytes.size());
  const std::size_t length = 1 + below(std::min<std::size_t>(bytes.size() - begin, 64));
  const Bytes block(bytes.begin() + at(begin), bytes.begin() + at(begin + length));
  switch (below(6)) {
    case 0:
      replace(bytes, begin, begin + length, {});
      break;
    case 1:
      bytes.resize(begin);
      break;
    case 2:
      bytes.insert(bytes.begin() + at(below(bytes.size())), block.begin(), block.end());
      break;
    case 3: {  // deep nesting, and long words and lists
      const std::size_t most = std::min<std::size_t>(kMostBytes - bytes.size(), 60000) / length;
      for (std::size_t i = 0, times = below(most + 1) >> below(12); i < times; ++i)
        bytes.insert(bytes.begin() + at(begin), block.begin(), block.end());
      break;
    }
    case 4: {
      const Bytes& other = corpus[below(corpus.size())];
      const std::size_t from = below(other.size());
      const std::size_t count = 1 + below(std::min<std::size_t>(other.size() - from, 256));
      replace(bytes, begin, std::min(begin + count, bytes.size()),
              Bytes(other.begin() + at(from), other.begin() + at(from + count)));
      break;
    }
    default:
      bytes.insert(bytes.begin() + at(begin), 1 + below(16), kBytes[below(kBytes.size())]);
  }
}

void Mutator::change_number(Bytes& bytes) {
  // The digit at or after a random place.
  const std::size_t from = below(bytes.size());
  const auto digit = std::find_if(bytes.begin() + at(from), bytes.end(),
                                  [](std::uint8_t c) { return std::isdigit(c) != 0; });
  if (digit == bytes.end()) return;
  const auto [begin, end] =
      run_around(bytes, static_cast<std::size_t>(digit - bytes.begin()), is_in_number);
  const std::string number = kNumbers[below(kNumbers.size())];
  replace(bytes, begin, end, Bytes(number.begin(), number.end()));
}

void Mutator::change_words(Bytes& bytes) {
  const auto in_line = [](std::uint8_t c) { return c != '\n'; };
  const auto in_word = [](std::uint8_t c) { return std::isalnum(c) != 0 || c == '_'; };
  const std::size_t from = below(bytes.size());
  const std::size_t to = below(bytes.size());
  const bool lines = below(2) == 0;
  const auto [begin, end] =
      lines ? run_around(bytes, from, in_line) : run_around(bytes, from, in_word);
  const auto [other_begin, other_end] =
      lines ? run_around(bytes, to, in_line) : run_around(bytes, to, in_word);
  const Bytes other(bytes.begin() + at(other_begin), bytes.begin() + at(other_end));
  replace(bytes, begin, end, other);
}

Bytes Mutator::mutated(const std::vector<Bytes>& corpus, std::size_t seeds) {
  Bytes bytes = corpus[below(below(2) == 0 ? seeds : corpus.size())];
  do {
    if (bytes.empty()) bytes = corpus[below(seeds)];
    switch (below(8)) {
      case 0:
      case 1:
      case 2:
        change_bytes(bytes);
        break;
      case 3:
      case 4:
        change_blocks(bytes, corpus);
        break;
      case 5:
        change_words(bytes);
        break;
      default:
        change_number(bytes);
    }
  } while (below(3) == 0);
  if (bytes.size() > kMostBytes) bytes.resize(kMostBytes);
  return bytes;
}

}  // namespace usct::fuzz
