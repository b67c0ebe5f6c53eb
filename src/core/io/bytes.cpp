#include "io/bytes.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

std::ifstream open(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) throw InputError(path.string(), "does not exist");
  if (error) throw InputError(path.string(), "cannot be opened: " + error.message());
  if (fs::is_directory(status)) throw InputError(path.string(), "is a folder, must be a file");
  // A pipe or a device has no size against which a header could be checked.
  if (!fs::is_regular_file(status)) throw InputError(path.string(), "is not a regular file");
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw InputError(path.string(), std::string("cannot be opened: ") + std::strerror(errno));
  return file;
}

Bytes read_at_most(const fs::path& path, std::uintmax_t limit) {
  std::ifstream file = open(path);
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) throw InputError(path.string(), "has no size: " + error.message());
  if (size == 0) throw InputError(path.string(), "is empty");
  Bytes bytes;
  try {
    bytes.resize(static_cast<std::size_t>(std::min(size, limit)));
  } catch (const std::exception&) {
    throw InputError(path.string(), "has " + std::to_string(size) + " bytes, too many for memory");
  }
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) throw InputError(path.string(), "could not be read to its end");
  return bytes;
}

}  // namespace

Bytes read_bytes(const fs::path& path) {
  return read_at_most(path, std::numeric_limits<std::uintmax_t>::max());
}

Bytes read_text_bytes(const fs::path& path) {
  constexpr std::size_t kMost = std::size_t{64} << 20;
  Bytes bytes = read_at_most(path, kMost + 1);
  if (bytes.size() > kMost) throw InputError(path.string(), "is larger than 64 MiB");
  return bytes;
}

Bytes read_prefix(const fs::path& path, std::size_t count) { return read_at_most(path, count); }

void read_bytes_into(const fs::path& path, std::uintmax_t offset, void* out, std::size_t count) {
  std::ifstream file = open(path);
  file.seekg(static_cast<std::streamoff>(offset));
  file.read(static_cast<char*>(out), static_cast<std::streamsize>(count));
  if (!file) throw InputError(path.string(), "could not be read to its end");
}

void write_bytes(const fs::path& target, const Bytes& bytes) {
  write_text(target, text_view(bytes));
}

}  // namespace usct::io
