#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "us_ct_registration/io/ultrasound/probe_config.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

/// Files that Ultrasonix scanners save: `.bpr` and its family.
///
/// A file has a header of 19 int32, little-endian, then the frames. Software older than 6.0.0 puts
/// an int32 tag before each frame, which shows in the size of the file.
///
/// | type | extension | content | read |
/// |---|---|---|---|
/// | 2 | .bpr | B before scan conversion, 8 bit: lines of h samples | yes |
/// | 4 | .b8 | B after scan conversion, 8 bit: rows of w pixels | yes |
/// | 8, 16, 32, ... | .b32, .rf, .mpr, ... | colour, RF, M, Doppler, elastography, ECG | no, named
/// |
namespace usct {

/// The header as it stands in the file.
struct UltrasonixHeader {
  std::int32_t type = 0;
  std::int32_t frames = 0;
  std::int32_t w = 0;   // lines, or width of the image
  std::int32_t h = 0;   // samples per line, or height of the image
  std::int32_t ss = 0;  // bits per sample
  std::int32_t ulx = 0, uly = 0, urx = 0, ury = 0, brx = 0, bry = 0, blx = 0, bly = 0;  // pixels
  std::int32_t probe = 0;
  std::int32_t txf = 0;  // transmit frequency, Hz
  std::int32_t sf = 0;   // sampling frequency of the stored samples, Hz
  std::int32_t dr = 0;   // frames per second
  std::int32_t ld = 0;   // line density
  std::int32_t extra = 0;
};

constexpr std::int32_t kUltrasonixPreScanB = 2;
constexpr std::int32_t kUltrasonixPostScanB = 4;

struct UltrasonixSequence {
  UltrasonixHeader header;
  /// The tag before each frame; empty if the file has none.
  std::vector<std::int32_t> frame_tags;
  /// Frame by frame; type 2: sample fastest, then line; type 4: column fastest, then row.
  std::vector<std::uint8_t> voxels;
};

/// The meaning of a header type, for messages: "B before scan conversion (.bpr)", "unknown", ...
std::string ultrasonix_type_name(std::int32_t type);

/// Whether the file has a header of this family and a size that fits it. False for anything else,
/// also for a file that cannot be opened.
bool is_ultrasonix(const std::filesystem::path& path);

/// Throws InputError, naming file, field and constraint, if the type is not one that is read, a
/// size is not positive, or the file's size does not follow from the header, with or without frame
/// tags.
UltrasonixSequence read_ultrasonix(const std::filesystem::path& path);

/// Writes atomically, with tags if there are any. Throws InputError if header, tags and voxels do
/// not fit each other.
void write_ultrasonix(const UltrasonixSequence& sequence, const std::filesystem::path& path);

/// One sweep out of a recording of a motorised probe.
struct SweepSelection {
  int index = 0;
  /// Number of frames per sweep, which must divide the frames of the recording; 0: all frames are
  /// one sweep.
  int frames_per_sweep = 0;
  /// Whether the first sweep runs against the probe's frame angles; sweeps alternate direction.
  bool first_backward = false;
};

/// One sweep of a motorised probe. Frames stay in the order of recording: a backward sweep has its
/// motor angles in reverse order. `source` names the data in messages. Throws InputError as
/// `motorised_geometry`, or if the type is not 2, the frames are not whole sweeps, the sweep does
/// not exist, or the sampling frequency is needed and not within 0.1-100 MHz.
PreScanVolume to_prescan(const UltrasonixSequence& sequence, const ProbeConfig& probe,
                         const SweepSelection& selection, const std::string& source);

/// All frames of a recording of a tracked probe, with one pose each. Throws InputError as
/// `tracked_geometry`, or if the type is not 2 or the sampling frequency is needed and not within
/// 0.1-100 MHz.
PreScanVolume to_prescan(const UltrasonixSequence& sequence, const ProbeConfig& probe,
                         const TrackedSweep& sweep, const std::string& source);

/// Entries in the table of formats: see UltrasoundFormat and FileFormat::describe. The written
/// sampling frequency is that of the sample spacing at 1540 m/s. A tracked sweep and frames that
/// are not evenly spaced are not written.
UltrasoundInput read_ultrasonix_ultrasound(const UltrasoundSource& source);
void write_ultrasonix_beams(const PreScanVolume& volume, const std::filesystem::path& path);
std::string describe_ultrasonix(const std::filesystem::path& path);

}  // namespace usct
