#include "ros/conversions/ct.h"

#include <zlib.h>

#include <array>

#include "ros/conversions/checks.h"
#include "ros/conversions/poses.h"

namespace usct::ros_interface {

namespace msg = us_ct_registration;

namespace {

/// zlib's CRC-32 of all that says where which voxel is. A CT with the same voxels elsewhere is
/// another one: an alignment of the first does not hold for it.
std::uint32_t checksum_of(const msg::CtVolume& message) {
  uLong crc = checksum(message.data);
  const auto add = [&](const auto& numbers) {
    crc = crc32_z(crc, reinterpret_cast<const Bytef*>(numbers.data()),
                  numbers.size() * sizeof(numbers[0]));
  };
  add(message.size);
  add(message.spacing);
  add(std::array{message.origin.x, message.origin.y, message.origin.z});
  add(message.direction);
  return static_cast<std::uint32_t>(crc);
}

}  // namespace

msg::CtVolume to_message(const CtVolume& ct, const std_msgs::Header& header, unsigned revision) {
  ct.grid.validate("CT");
  msg::CtVolume message;
  message.header = header;
  message.revision = revision;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    message.size[i] = static_cast<std::uint32_t>(ct.grid.size[axis]);
    message.spacing[i] = ct.grid.spacing_mm[axis] / kMmPerM;
    for (int column = 0; column < 3; ++column)
      message.direction[3 * i + static_cast<std::size_t>(column)] = ct.grid.direction(axis, column);
  }
  message.origin = to_message(ct.grid.origin_mm);
  message.data = ct.voxels;
  message.crc32 = checksum_of(message);
  return message;
}

CtVolume from_message(const msg::CtVolume& message, const std::string& source) {
  require_size(
      {{"size[0]", message.size[0]}, {"size[1]", message.size[1]}, {"size[2]", message.size[2]}},
      message.data.size(), source);
  CtVolume ct;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    ct.grid.size[axis] = static_cast<int>(message.size[i]);
    ct.grid.spacing_mm[axis] = kMmPerM * message.spacing[i];
    for (int column = 0; column < 3; ++column)
      ct.grid.direction(axis, column) = message.direction[3 * i + static_cast<std::size_t>(column)];
  }
  ct.grid.origin_mm = point_from_message_mm(message.origin);
  ct.grid.validate(source);
  require_checksum(checksum_of(message), message.crc32, source);
  ct.voxels = message.data;
  return ct;
}

}  // namespace usct::ros_interface
