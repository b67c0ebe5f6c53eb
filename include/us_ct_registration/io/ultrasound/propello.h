#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "us_ct_registration/io/ultrasound/probe_config.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

/// Volumes that Ultrasonix' Propello saves: `.vol`.
///
/// A header of 7 int32, little-endian, then volumes of fpv frames. Types: 0, B before scan
/// conversion, 8 bit (lines of h samples; read); 1, B after scan conversion, 8 bit (rows of w
/// pixels; read); 2, RF, 3, colour, and 4, colour after scan conversion, are refused by name.
namespace usct {

/// The header as it stands in the file.
struct PropelloHeader {
  std::int32_t type = 0;
  std::int32_t volumes = 0;
  std::int32_t fpv = 0;       // frames per volume
  std::int32_t w = 0;         // lines, or width of the image
  std::int32_t h = 0;         // samples per line, or height of the image
  std::int32_t ss = 0;        // bits per sample
  std::int32_t degPerFr = 0;  // angle between frames in 1/1000 degree, truncated
};

struct PropelloVolumes {
  PropelloHeader header;
  /// Volume by volume, frame by frame; type 0: sample fastest, then line.
  std::vector<std::uint8_t> voxels;
};

/// The meaning of a header type, for messages.
std::string propello_type_name(std::int32_t type);

/// Whether the file has such a header and exactly the size that it states. False for anything else,
/// also for a file that cannot be opened.
bool is_propello(const std::filesystem::path& path);

/// Throws InputError, naming file, field and constraint, if the type is not one that is read, a
/// size is not positive, or the file's size does not follow from the header.
PropelloVolumes read_propello(const std::filesystem::path& path);

/// Writes atomically. Throws InputError if header and voxels do not fit each other.
void write_propello(const PropelloVolumes& volumes, const std::filesystem::path& path);

/// One volume of a motorised probe. The motor sweeps without a stop, so that volumes alternate
/// direction: volume 0 is in the direction of the probe's frame angles, unless `first_backward`.
/// Frames stay in the order of recording: a backward volume has its motor angles in reverse order.
///
/// `source` names the data in messages. Throws InputError as `motorised_geometry`, or if the type
/// is not 0 or the volume does not exist.
PreScanVolume to_prescan(const PropelloVolumes& volumes, const ProbeConfig& probe, int volume,
                         bool first_backward, const std::string& source);

/// Entries in the table of formats: see UltrasoundFormat and FileFormat::describe. Writing throws
/// InputError for what the header cannot state: a tracked sweep, or uneven motor angles.
UltrasoundInput read_propello_ultrasound(const UltrasoundSource& source);
void write_propello_beams(const PreScanVolume& volume, const std::filesystem::path& path);
std::string describe_propello(const std::filesystem::path& path);

}  // namespace usct
