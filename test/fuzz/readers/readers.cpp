#include "readers.h"

#include "us_ct_registration/io/formats.h"

namespace usct::fuzz {

io::Bytes written(const std::filesystem::path& folder, const std::string& name,
                  const std::function<void(const std::filesystem::path&)>& write) {
  const std::filesystem::path path = folder / name;
  write(path);
  io::Bytes bytes = io::read_bytes(path);
  std::filesystem::remove(path);
  return bytes;
}

void describe(const std::filesystem::path& path) { detect_format(path).describe(path); }

}  // namespace usct::fuzz
