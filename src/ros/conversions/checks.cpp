#include "ros/conversions/checks.h"

#include <zlib.h>

#include <limits>

namespace usct::ros_interface {

void require_count(const char* name, std::size_t count, std::size_t wanted,
                   const std::string& source) {
  require(count == wanted, source,
          "'" + std::string(name) + "' has " + std::to_string(count) + " entries, must have " +
              std::to_string(wanted));
}

void require_size(std::initializer_list<std::pair<const char*, std::uint32_t>> sizes,
                  std::size_t data, const std::string& source) {
  std::string product;
  double voxels = 1.0;
  for (const auto& [name, size] : sizes) {
    require(
        size >= 1 && size <= static_cast<std::uint32_t>(std::numeric_limits<std::int32_t>::max()),
        source, "'" + std::string(name) + "' is " + std::to_string(size) + ", must be >= 1");
    voxels *= size;
    product += (product.empty() ? "" : " x ") + std::to_string(size);
  }
  require(voxels == static_cast<double>(data), source,
          "'data' has " + std::to_string(data) + " values, must have " + product);
}

template <typename T>
std::uint32_t checksum(const std::vector<T>& data) {
  const auto* bytes = reinterpret_cast<const Bytef*>(data.data());
  return static_cast<std::uint32_t>(crc32_z(0, bytes, data.size() * sizeof(T)));
}

void require_checksum(std::uint32_t found, std::uint32_t expected, const std::string& source) {
  require(found == expected, source,
          "the checksum is " + std::to_string(found) + ", 'crc32' says " +
              std::to_string(expected) + ": the message was damaged on its way");
}

template std::uint32_t checksum(const std::vector<std::uint8_t>&);
template std::uint32_t checksum(const std::vector<std::int16_t>&);

}  // namespace usct::ros_interface
