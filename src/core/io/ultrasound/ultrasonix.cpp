#include "us_ct_registration/io/ultrasound/ultrasonix.h"

#include <cmath>

#include "io/bytes.h"
#include "io/description.h"
#include "io/ultrasound/recordable_sweep.h"
#include "io/ultrasound/ultrasonix_format.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr double kSpeedOfSoundMPerS = 1540.0;

/// The header's information about the frames. The sampling frequency is used only if the probe's
/// configuration has no sample spacing.
RecordedFrames recorded_frames(const UltrasonixSequence& sequence, const ProbeConfig& probe,
                               const std::string& source) {
  const UltrasonixHeader& header = sequence.header;
  if (header.type != kUltrasonixPreScanB)
    throw InputError(source, "'type' is " + std::to_string(header.type) + ", " +
                                 ultrasonix_type_name(header.type) + ", must be 2 (.bpr)");
  RecordedFrames recorded;
  recorded.samples = header.h;
  recorded.lines = header.w;
  recorded.frames = header.frames;
  const ProbeSampling& sampling = probe.sampling;
  if (sampling.sample_spacing_mm || sampling.imaging_depth_mm || sampling.sampling_frequency_hz)
    return recorded;
  // Some software does not set this field; an implausible value must not become a geometry.
  constexpr std::int32_t kLowestHz = 100'000;
  constexpr std::int32_t kHighestHz = 100'000'000;
  if (header.sf < kLowestHz || header.sf > kHighestHz)
    throw InputError(source, "sampling frequency 'sf' is " + std::to_string(header.sf) +
                                 " Hz, must be 0.1 to 100 MHz; or else the probe's configuration "
                                 "must have 'sample_spacing_mm' or 'imaging_depth_mm'");
  recorded.sampling_frequency_hz = header.sf;
  return recorded;
}

}  // namespace

bool is_ultrasonix(const std::filesystem::path& path) {
  try {
    const io::Bytes prefix = io::read_prefix(path, io::kUltrasonixHeaderBytes);
    std::error_code error;  // on an error the size is the largest integer, which fits no header
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    io::parse_ultrasonix_header(prefix, size, path.string());
    return true;
  } catch (const InputError&) {
    return false;
  }
}

UltrasonixSequence read_ultrasonix(const std::filesystem::path& path) {
  return io::parse_ultrasonix(io::read_bytes(path), path.string());
}

void write_ultrasonix(const UltrasonixSequence& sequence, const std::filesystem::path& path) {
  io::write_bytes(path, io::format_ultrasonix(sequence, path.string()));
}

PreScanVolume to_prescan(const UltrasonixSequence& sequence, const ProbeConfig& probe,
                         const SweepSelection& selection, const std::string& source) {
  RecordedFrames recorded = recorded_frames(sequence, probe, source);
  if (selection.frames_per_sweep < 0 || selection.frames_per_sweep > recorded.frames)
    throw InputError(source, "has " + std::to_string(recorded.frames) +
                                 " frames, 'frames_per_sweep' is " +
                                 std::to_string(selection.frames_per_sweep));
  const int sweeps =
      selection.frames_per_sweep == 0 ? 1 : recorded.frames / selection.frames_per_sweep;
  // A number that is off by a few frames would take each sweep from its neighbour's frames, at
  // wrong angles of the motor, and no image shows it.
  const int left = recorded.frames - sweeps * selection.frames_per_sweep;
  if (selection.frames_per_sweep > 0 && left > 0)
    throw InputError(source,
                     "has " + std::to_string(recorded.frames) + " frames, 'frames_per_sweep' is " +
                         std::to_string(selection.frames_per_sweep) + ", must divide them (" +
                         std::to_string(left) + " frames are left over)");
  if (selection.index < 0 || selection.index >= sweeps)
    throw InputError(source, "has " + std::to_string(sweeps) + " sweeps, number " +
                                 std::to_string(selection.index) + " (from 0) was asked for");
  if (selection.frames_per_sweep > 0) recorded.frames = selection.frames_per_sweep;
  recorded.backward = (selection.index % 2 == 1) != selection.first_backward;
  PreScanVolume volume;
  volume.geometry = motorised_geometry(probe, recorded, source);
  const std::size_t size = static_cast<std::size_t>(recorded.frames) *
                           static_cast<std::size_t>(recorded.lines) *
                           static_cast<std::size_t>(recorded.samples);
  const std::uint8_t* begin =
      sequence.voxels.data() + static_cast<std::size_t>(selection.index) * size;
  volume.voxels.assign(begin, begin + size);
  return volume;
}

PreScanVolume to_prescan(const UltrasonixSequence& sequence, const ProbeConfig& probe,
                         const TrackedSweep& sweep, const std::string& source) {
  PreScanVolume volume;
  volume.geometry =
      tracked_geometry(probe, recorded_frames(sequence, probe, source), sweep, source);
  volume.voxels = sequence.voxels;
  return volume;
}

UltrasoundInput read_ultrasonix_ultrasound(const UltrasoundSource& source) {
  const ProbeConfig probe = read_probe_config(source.probe);
  const SweepSelection selection{source.sweep, source.frames_per_sweep, source.first_backward};
  return {to_prescan(read_ultrasonix(source.path), probe, selection, source.path.string()), {}};
}

void write_ultrasonix_beams(const PreScanVolume& volume, const std::filesystem::path& path) {
  io::recordable_pitch_rad(volume, path);  // the probe's YAML states it
  UltrasonixSequence sequence;
  UltrasonixHeader& h = sequence.header;
  h.type = kUltrasonixPreScanB;
  h.frames = volume.geometry.frames();
  h.w = volume.geometry.lines();
  h.h = volume.geometry.samples();
  h.ss = 8;
  // The echo travels there and back: one sample is speed / (2 frequency) deep.
  h.sf = static_cast<std::int32_t>(
      std::lround(kSpeedOfSoundMPerS * 1000.0 / (2.0 * volume.geometry.axial.spacing_mm)));
  sequence.voxels = volume.voxels;
  write_ultrasonix(sequence, path);
}

std::string describe_ultrasonix(const std::filesystem::path& path) {
  const UltrasonixSequence sequence = read_ultrasonix(path);
  const UltrasonixHeader& h = sequence.header;
  io::Json json;
  json["type"] = ultrasonix_type_name(h.type);
  json["w_h_frames"] = {h.w, h.h, h.frames};
  json["transmit_frequency_hz"] = h.txf;
  json["sampling_frequency_hz"] = h.sf;
  json["frames_per_second"] = h.dr;
  json["frame_tags"] = !sequence.frame_tags.empty();
  json["warnings"] = io::Json::array();
  io::describe_brightness(sequence.voxels, json);
  return io::as_text(json);
}

}  // namespace usct
