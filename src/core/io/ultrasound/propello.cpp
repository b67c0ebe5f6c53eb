#include "us_ct_registration/io/ultrasound/propello.h"

#include "io/bytes.h"
#include "io/ultrasound/propello_format.h"
#include "us_ct_registration/error.h"

namespace usct {

bool is_propello(const std::filesystem::path& path) {
  try {
    const io::Bytes prefix = io::read_prefix(path, io::kPropelloHeaderBytes);
    std::error_code error;  // then the size is one that fits no header
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    io::parse_propello_header(prefix, size, path.string());
    return true;
  } catch (const InputError&) {
    return false;
  }
}

PropelloVolumes read_propello(const std::filesystem::path& path) {
  return io::parse_propello(io::read_bytes(path), path.string());
}

void write_propello(const PropelloVolumes& volumes, const std::filesystem::path& path) {
  io::write_bytes(path, io::format_propello(volumes, path.string()));
}

PreScanVolume to_prescan(const PropelloVolumes& volumes, const ProbeConfig& probe, int volume,
                         bool first_backward, const std::string& source) {
  const PropelloHeader& header = volumes.header;
  if (header.type != 0)
    throw InputError(source, "'type' is " + std::to_string(header.type) + ", " +
                                 propello_type_name(header.type) + ", must be 0");
  if (volume < 0 || volume >= header.volumes)
    throw InputError(source, "has " + std::to_string(header.volumes) + " volumes, number " +
                                 std::to_string(volume) + " (from 0) was asked for");
  RecordedFrames recorded;
  recorded.samples = header.h;
  recorded.lines = header.w;
  recorded.frames = header.fpv;
  recorded.frame_pitch_millidegrees = header.degPerFr;
  recorded.backward = (volume % 2 == 1) != first_backward;
  PreScanVolume result;
  result.geometry = motorised_geometry(probe, recorded, source);
  const std::size_t size = static_cast<std::size_t>(header.fpv) *
                           static_cast<std::size_t>(header.w) * static_cast<std::size_t>(header.h);
  const std::uint8_t* begin = volumes.voxels.data() + static_cast<std::size_t>(volume) * size;
  result.voxels.assign(begin, begin + size);
  return result;
}

}  // namespace usct
