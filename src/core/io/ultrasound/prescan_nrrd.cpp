#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

#include <string_view>

#include "io/bytes.h"
#include "io/sibling_file.h"
#include "io/ultrasound/prescan_nrrd_format.h"
#include "io/utc_time.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

/// Our writer puts the key at the front, other programs sort them after tables of any length.
constexpr std::size_t kPeekedBytes = std::size_t{1} << 20;

}  // namespace

bool is_prescan_nrrd(const std::filesystem::path& path) {
  try {
    const io::Bytes bytes = io::read_prefix(path, kPeekedBytes);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const std::string_view header = text.substr(0, text.find("\n\n"));
    return header.substr(0, 4) == "NRRD" && header.find("\nusct_geometry:=") != header.npos;
  } catch (const InputError&) {
    return false;
  }
}

PreScanVolume read_prescan_nrrd(const std::filesystem::path& path) {
  return io::parse_prescan_nrrd(io::read_bytes(path), path.string(), [&](const std::string& name) {
    return io::read_bytes(io::sibling_file(path, name, "data file"));
  });
}

void write_prescan_nrrd(const PreScanVolume& volume, const std::filesystem::path& path) {
  volume.validate(path.string());
  if (!volume.acquisition_time.empty())
    io::check_utc_time(volume.acquisition_time, path.string(), "acquisition_time");
  io::write_bytes(path, io::format_prescan_nrrd(volume));
}

}  // namespace usct
