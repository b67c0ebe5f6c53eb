#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "io/bytes.h"
#include "io/dicom/dicom_codecs.h"
#include "io/dicom/dicom_file.h"
#include "io/format.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

[[noreturn]] void refuse(const DicomFile& file, const std::string& violation) {
  throw InputError(file.path.string(), violation);
}

FrameFormat frame_format(const DicomImages& images) {
  FrameFormat format;
  format.columns = images.columns;
  format.rows = images.rows;
  format.bits_allocated = images.bits_allocated;
  format.bits_stored = images.bits_stored;
  format.is_signed = images.is_signed;
  return format;
}

void check_length(const DicomFile& file) {
  const DicomImages& images = file.images;
  const std::uint64_t wanted =
      static_cast<std::uint64_t>(frame_format(images).bytes()) * images.frames.size();
  const std::uint64_t length = images.pixels.ranges.front().length;
  if (length != wanted && length != wanted + wanted % 2)  // values are padded to even lengths
    refuse(file, "'PixelData' has " + std::to_string(length) + " bytes, must have " +
                     std::to_string(wanted) + " for " + std::to_string(images.frames.size()) +
                     " frames of " + std::to_string(images.rows) + " rows and " +
                     std::to_string(images.columns) + " columns");
}

/// The index of the first fragment of each frame. The Basic Offset Table (PS3.5 A.4) states for
/// each frame where its first fragment begins, in bytes behind the first fragment of all.
std::vector<std::size_t> first_fragments(const DicomFile& file) {
  const std::vector<ByteRange>& fragments = file.images.pixels.ranges;
  const std::size_t frames = file.images.frames.size();
  if (file.images.pixels.offset_table.length != 4 * frames)
    refuse(file, "'PixelData' has " + std::to_string(fragments.size()) +
                     " fragments, must have one for each of " + std::to_string(frames) +
                     " frames, or a table of their offsets");
  const Bytes table = read_range(file.path, file.images.pixels.offset_table);
  std::vector<std::size_t> first;
  std::size_t at = 0;
  for (std::size_t frame = 0; frame < frames; ++frame, ++at) {
    const auto offset = static_cast<std::uint32_t>(int32_le(table, 4 * frame));
    while (at < fragments.size() && fragments[at].begin - fragments[0].begin != offset) ++at;
    if (at == fragments.size() || (frame == 0 && at > 0))
      refuse(file, "frame " + std::to_string(frame + 1) + " begins at byte " +
                       std::to_string(offset) +
                       " by the table of offsets, where no fragment after the frame before does");
    first.push_back(at);
  }
  return first;
}

/// The compressed stream of one frame: its own fragment, or several one after the other.
Bytes frame_stream(const DicomFile& file, std::size_t frame) {
  const std::vector<ByteRange>& fragments = file.images.pixels.ranges;
  const std::size_t frames = file.images.frames.size();
  if (frames == fragments.size()) return read_range(file.path, fragments[frame]);
  std::size_t begin = 0;
  std::size_t end = fragments.size();
  if (frames > 1) {
    const std::vector<std::size_t> first = first_fragments(file);
    begin = first[frame];
    if (frame + 1 < frames) end = first[frame + 1];
  }
  Bytes stream;
  for (std::size_t i = begin; i < end; ++i) {
    const Bytes part = read_range(file.path, fragments[i]);
    stream.insert(stream.end(), part.begin(), part.end());
  }
  return stream;
}

/// The stored values of one frame, little-endian.
Bytes stored_frame(const DicomFile& file, std::size_t frame) {
  const DicomImages& images = file.images;
  const FrameFormat format = frame_format(images);
  if (images.pixels.encapsulated)
    return decompress_frame(file.path.string(), file.transfer_syntax_uid, format,
                            frame_stream(file, frame));
  const std::uint64_t begin = images.pixels.ranges.front().begin;
  Bytes stored = read_range(file.path, {begin + frame * format.bytes(), format.bytes()});
  if (images.big_endian && images.bits_allocated == 16)
    for (std::size_t i = 0; i + 1 < stored.size(); i += 2) std::swap(stored[i], stored[i + 1]);
  return stored;
}

template <typename Raw>
void to_hounsfield(const DicomFile& file, std::size_t frame, const Bytes& stored,
                   std::int16_t* hounsfield) {
  const DicomImages& images = file.images;
  const double slope = images.frames[frame].slope;
  const double intercept = images.frames[frame].intercept;
  // The standard leaves the bits above BitsStored undefined.
  const int unused = images.bits_allocated - images.bits_stored;
  using Signed = std::make_signed_t<Raw>;
  for (std::size_t i = 0; i < images.frame_pixels(); ++i) {
    Raw raw;
    std::memcpy(&raw, &stored[i * sizeof(Raw)], sizeof(Raw));
    raw = static_cast<Raw>(raw << unused);
    const int value = images.is_signed ? static_cast<Signed>(raw) >> unused : raw >> unused;
    double hu = std::nearbyint(value * slope + intercept);
    // Nothing was measured where there is padding.
    const bool is_padding =
        images.padding && value >= images.padding->first && value <= images.padding->second;
    if (is_padding && (hu < kAirHu || hu > kDensestTissueHu)) hu = kAirHu;
    if (!(hu >= std::numeric_limits<std::int16_t>::min() &&
          hu <= std::numeric_limits<std::int16_t>::max()))
      refuse(file, "a pixel is " + format(hu) + " HU ('RescaleSlope' " + format(slope) +
                       ", 'RescaleIntercept' " + format(intercept) +
                       "), must be from -32768 to 32767");
    hounsfield[i] = static_cast<std::int16_t>(hu);
  }
}

}  // namespace

std::vector<std::int16_t> read_dicom_hounsfield(const DicomFile& file, std::size_t frame) {
  const DicomImages& images = file.images;
  if (!images.pixels.encapsulated) check_length(file);
  const Bytes stored = stored_frame(file, frame);
  std::vector<std::int16_t> hounsfield(images.frame_pixels());
  if (images.bits_allocated == 8)
    to_hounsfield<std::uint8_t>(file, frame, stored, hounsfield.data());
  else
    to_hounsfield<std::uint16_t>(file, frame, stored, hounsfield.data());
  return hounsfield;
}

}  // namespace usct::io
