#include "io/ultrasound/ultrasonix_format.h"

#include <array>
#include <utility>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

using UltrasonixField = std::int32_t UltrasonixHeader::*;

/// The fields of the header in the order of the file.
constexpr std::array<UltrasonixField, 19> kUltrasonixFields = {
    &UltrasonixHeader::type, &UltrasonixHeader::frames, &UltrasonixHeader::w,
    &UltrasonixHeader::h,    &UltrasonixHeader::ss,     &UltrasonixHeader::ulx,
    &UltrasonixHeader::uly,  &UltrasonixHeader::urx,    &UltrasonixHeader::ury,
    &UltrasonixHeader::brx,  &UltrasonixHeader::bry,    &UltrasonixHeader::blx,
    &UltrasonixHeader::bly,  &UltrasonixHeader::probe,  &UltrasonixHeader::txf,
    &UltrasonixHeader::sf,   &UltrasonixHeader::dr,     &UltrasonixHeader::ld,
    &UltrasonixHeader::extra};

constexpr std::array<std::pair<std::int32_t, const char*>, 18> kUltrasonixTypes = {{
    {0x1, "screen"},
    {0x2, "B before scan conversion (.bpr)"},
    {0x4, "B after scan conversion, 8 bit (.b8)"},
    {0x8, "B after scan conversion, 32 bit (.b32)"},
    {0x10, "RF (.rf)"},
    {0x20, "M before scan conversion (.mpr)"},
    {0x40, "M after scan conversion (.m)"},
    {0x80, "pulsed-wave RF (.drf)"},
    {0x100, "pulsed-wave spectrum (.pw)"},
    {0x200, "colour RF (.crf)"},
    {0x400, "colour (.col)"},
    {0x800, "colour velocity and variance (.cvv)"},
    {0x2000, "elastography and B (.el)"},
    {0x4000, "elastography overlay (.elo)"},
    {0x8000, "elastography before scan conversion (.epr)"},
    {0x10000, "ECG (.ecg)"},
    {0x20000, "GPS (.gps)"},
    {0x10000000, "PNG (.png)"},
}};

}  // namespace

std::string ultrasonix_type_name(std::int32_t type) {
  for (const auto& [number, name] : kUltrasonixTypes)
    if (number == type) return name;
  return "unknown";
}

}  // namespace usct

namespace usct::io {
namespace {

void check_type(const UltrasonixHeader& header, const std::string& source) {
  if (header.type != kUltrasonixPreScanB && header.type != kUltrasonixPostScanB)
    throw InputError(source, "'type' is " + std::to_string(header.type) + ", " +
                                 ultrasonix_type_name(header.type) +
                                 ", must be 2 (.bpr) or 4 (.b8)");
  if (header.ss != 8)
    throw InputError(source, "'ss' is " + std::to_string(header.ss) + " bits, must be 8");
}

}  // namespace

UltrasonixLayout parse_ultrasonix_header(const Bytes& prefix, std::uint64_t file_size,
                                         const std::string& source) {
  if (prefix.size() < kUltrasonixHeaderBytes)
    throw InputError(source, "has " + std::to_string(prefix.size()) +
                                 " bytes, the header alone needs " +
                                 std::to_string(kUltrasonixHeaderBytes));
  UltrasonixLayout layout;
  for (std::size_t i = 0; i < kUltrasonixFields.size(); ++i)
    layout.header.*kUltrasonixFields[i] = int32_le(prefix, 4 * i);
  const UltrasonixHeader& header = layout.header;
  check_type(header, source);
  const std::uint64_t frames = size_product({header.frames}, source, "frames");
  layout.frame_bytes =
      size_product({header.w}, source, "w") * size_product({header.h}, source, "h");
  const std::uint64_t bare = size_product({header.frames, header.w, header.h}, source, "w x h");
  constexpr std::uint64_t kTagBytes = 4;
  const std::uint64_t data_bytes = file_size - kUltrasonixHeaderBytes;
  if (data_bytes == bare + kTagBytes * frames)
    layout.tag_bytes = kTagBytes;
  else if (data_bytes != bare)
    throw InputError(source, "has " + std::to_string(data_bytes) + " bytes after the header; " +
                                 std::to_string(frames) + " frames of " + std::to_string(header.w) +
                                 " x " + std::to_string(header.h) + " need " +
                                 std::to_string(bare) + ", or " +
                                 std::to_string(bare + kTagBytes * frames) + " with frame tags");
  return layout;
}

UltrasonixSequence parse_ultrasonix(Bytes bytes, const std::string& source) {
  const UltrasonixLayout layout = parse_ultrasonix_header(bytes, bytes.size(), source);
  UltrasonixSequence sequence;
  sequence.header = layout.header;
  // The frames are moved together in place, over the tags between them.
  auto target = bytes.begin();
  std::size_t offset = kUltrasonixHeaderBytes;
  for (std::int32_t frame = 0; frame < layout.header.frames; ++frame) {
    if (layout.tag_bytes > 0) sequence.frame_tags.push_back(int32_le(bytes, offset));
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(offset + layout.tag_bytes);
    target = std::copy(begin, begin + static_cast<std::ptrdiff_t>(layout.frame_bytes), target);
    offset += layout.tag_bytes + layout.frame_bytes;
  }
  bytes.erase(target, bytes.end());
  sequence.voxels = std::move(bytes);
  return sequence;
}

Bytes format_ultrasonix(const UltrasonixSequence& sequence, const std::string& source) {
  const UltrasonixHeader& header = sequence.header;
  check_type(header, source);
  const std::uint64_t size = size_product({header.frames, header.w, header.h}, source, "w x h");
  const bool tagged = !sequence.frame_tags.empty();
  const auto frames = static_cast<std::size_t>(header.frames);
  if (sequence.voxels.size() != size || (tagged && sequence.frame_tags.size() != frames))
    throw InputError(source, "voxels or frame tags do not fit the header's sizes");
  Bytes bytes;
  for (const UltrasonixField field : kUltrasonixFields) append_int32_le(bytes, header.*field);
  const std::size_t frame_bytes = sequence.voxels.size() / frames;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    if (tagged) append_int32_le(bytes, sequence.frame_tags[frame]);
    const std::uint8_t* begin = sequence.voxels.data() + frame * frame_bytes;
    bytes.insert(bytes.end(), begin, begin + frame_bytes);
  }
  return bytes;
}

}  // namespace usct::io
