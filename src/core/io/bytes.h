#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

/// Functions that all readers share: files as bytes, and products of sizes that cannot overflow.
namespace usct::io {

using Bytes = std::vector<std::uint8_t>;

/// The content of a file. Throws InputError, naming the path, if it is missing, not a regular file,
/// not readable, or empty.
Bytes read_bytes(const std::filesystem::path& path);

/// The content of a file that people write, such as YAML or a table. Throws as `read_bytes`, and if
/// it is larger than 64 MiB: it is another file then, which would take all memory.
Bytes read_text_bytes(const std::filesystem::path& path);

/// The first bytes of a file, at most `count`. Throws as `read_bytes`.
Bytes read_prefix(const std::filesystem::path& path, std::size_t count);

/// Reads `count` bytes of a file from `offset` on to `out`. Throws as `read_bytes`, and if the file
/// is shorter.
void read_bytes_into(const std::filesystem::path& path, std::uintmax_t offset, void* out,
                     std::size_t count);

inline std::string_view text_view(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Writes `target` atomically. Throws as `write_atomically`.
void write_bytes(const std::filesystem::path& target, const Bytes& bytes);

/// Product of sizes from a file, which may be wrong. Throws InputError, naming `field`, if a factor
/// is < 1 or the product exceeds 2^62.
std::uint64_t size_product(std::initializer_list<std::int64_t> factors, const std::string& source,
                           const std::string& field);

/// The little-endian int32 at a byte offset. The caller must have checked the offset.
std::int32_t int32_le(const Bytes& bytes, std::size_t offset);
void append_int32_le(Bytes& bytes, std::int32_t value);

}  // namespace usct::io
