#include "io/ultrasound/propello_format.h"

#include <array>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

using PropelloField = std::int32_t PropelloHeader::*;

/// The fields of the header in the order of the file.
constexpr std::array<PropelloField, 7> kPropelloFields = {
    &PropelloHeader::type, &PropelloHeader::volumes, &PropelloHeader::fpv,     &PropelloHeader::w,
    &PropelloHeader::h,    &PropelloHeader::ss,      &PropelloHeader::degPerFr};

}  // namespace

std::string propello_type_name(std::int32_t type) {
  constexpr std::array<const char*, 5> kNames = {
      "B before scan conversion", "B after scan conversion", "RF", "colour velocity and variance",
      "colour after scan conversion"};
  if (type < 0 || static_cast<std::size_t>(type) >= kNames.size()) return "unknown";
  return kNames[static_cast<std::size_t>(type)];
}

}  // namespace usct

namespace usct::io {
namespace {

/// Throws InputError unless files with this header are read. Returns the number of voxels.
std::uint64_t check_header(const PropelloHeader& header, const std::string& source) {
  if (header.type != 0 && header.type != 1)
    throw InputError(source, "'type' is " + std::to_string(header.type) + ", " +
                                 propello_type_name(header.type) +
                                 ", must be 0 or 1 (B before or after scan conversion)");
  if (header.ss != 8)
    throw InputError(source, "'ss' is " + std::to_string(header.ss) + " bits, must be 8");
  constexpr std::int32_t kHalfTurn = 180'000;
  if (header.degPerFr < 0 || header.degPerFr > kHalfTurn)
    throw InputError(source, "'degPerFr' is " + std::to_string(header.degPerFr) +
                                 " thousandths of a degree, must be 0 to " +
                                 std::to_string(kHalfTurn));
  size_product({header.volumes}, source, "volumes");
  size_product({header.fpv}, source, "fpv");
  size_product({header.w}, source, "w");
  size_product({header.h}, source, "h");
  return size_product({header.volumes, header.fpv, header.w, header.h}, source,
                      "volumes x fpv x w x h");
}

}  // namespace

PropelloHeader parse_propello_header(const Bytes& prefix, std::uint64_t file_size,
                                     const std::string& source) {
  if (prefix.size() < kPropelloHeaderBytes)
    throw InputError(source, "has " + std::to_string(prefix.size()) +
                                 " bytes, the header alone needs " +
                                 std::to_string(kPropelloHeaderBytes));
  PropelloHeader header;
  for (std::size_t i = 0; i < kPropelloFields.size(); ++i)
    header.*kPropelloFields[i] = int32_le(prefix, 4 * i);
  const std::uint64_t size = check_header(header, source);
  if (file_size - kPropelloHeaderBytes != size)
    throw InputError(source, "has " + std::to_string(file_size - kPropelloHeaderBytes) +
                                 " bytes after the header; " + std::to_string(header.volumes) +
                                 " volumes of " + std::to_string(header.fpv) + " frames of " +
                                 std::to_string(header.w) + " x " + std::to_string(header.h) +
                                 " need " + std::to_string(size));
  return header;
}

PropelloVolumes parse_propello(Bytes bytes, const std::string& source) {
  PropelloVolumes volumes;
  volumes.header = parse_propello_header(bytes, bytes.size(), source);
  bytes.erase(bytes.begin(), bytes.begin() + kPropelloHeaderBytes);
  volumes.voxels = std::move(bytes);
  return volumes;
}

Bytes format_propello(const PropelloVolumes& volumes, const std::string& source) {
  if (volumes.voxels.size() != check_header(volumes.header, source))
    throw InputError(source, "voxels do not fit the header's sizes");
  Bytes bytes;
  for (const PropelloField field : kPropelloFields) append_int32_le(bytes, volumes.header.*field);
  bytes.insert(bytes.end(), volumes.voxels.begin(), volumes.voxels.end());
  return bytes;
}

}  // namespace usct::io
