#include "us_ct_registration/io/ultrasound/propello.h"

#include <cmath>

#include "io/bytes.h"
#include "io/description.h"
#include "io/ultrasound/propello_format.h"
#include "io/ultrasound/recordable_sweep.h"
#include "us_ct_registration/error.h"

namespace usct {

bool is_propello(const std::filesystem::path& path) {
  try {
    const io::Bytes prefix = io::read_prefix(path, io::kPropelloHeaderBytes);
    std::error_code error;  // on an error the size is the largest integer, which fits no header
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

UltrasoundInput read_propello_ultrasound(const UltrasoundSource& source) {
  const ProbeConfig probe = read_probe_config(source.probe);
  return {to_prescan(read_propello(source.path), probe, source.sweep, source.first_backward,
                     source.path.string()),
          {}};
}

void write_propello_beams(const PreScanVolume& volume, const std::filesystem::path& path) {
  const double pitch_rad = io::recordable_pitch_rad(volume, path);
  PropelloVolumes volumes;
  volumes.header.volumes = 1;
  volumes.header.fpv = volume.geometry.frames();
  volumes.header.w = volume.geometry.lines();
  volumes.header.h = volume.geometry.samples();
  volumes.header.ss = 8;
  volumes.header.degPerFr = io::truncated_millidegrees(std::abs(pitch_rad));
  volumes.voxels = volume.voxels;
  write_propello(volumes, path);
}

std::string describe_propello(const std::filesystem::path& path) {
  const PropelloVolumes volumes = read_propello(path);
  const PropelloHeader& h = volumes.header;
  io::Json json;
  json["type"] = propello_type_name(h.type);
  json["volumes"] = h.volumes;
  json["w_h_frames"] = {h.w, h.h, h.fpv};
  json["frame_pitch_deg"] = h.degPerFr / 1000.0;
  json["warnings"] = io::Json::array();
  io::describe_brightness(volumes.voxels, json);
  return io::as_text(json);
}

}  // namespace usct
