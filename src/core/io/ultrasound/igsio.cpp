#include "us_ct_registration/io/ultrasound/igsio.h"

#include <string_view>

#include "io/bytes.h"
#include "io/sibling_file.h"
#include "io/ultrasound/igsio_format.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr std::size_t kHeaderBytes = std::size_t{1} << 16;

/// The meaning of the two letters for the in-plane axes. M and U are opposite directions, and so
/// are F and N.
struct InPlane {
  bool lines_contiguous;  // the fast axis runs along the lines (F or N)
  bool far;               // depth rises with the index
  bool marked;            // the lateral index rises towards the marked side
};

InPlane parse_in_plane(const std::string& orientation, const std::string& source) {
  const auto is = [&](std::size_t i, char a, char b) {
    return orientation[i] == a || orientation[i] == b;
  };
  if (orientation.size() >= 2) {
    if (is(0, 'F', 'N') && is(1, 'M', 'U'))
      return {true, orientation[0] == 'F', orientation[1] == 'M'};
    if (is(0, 'M', 'U') && is(1, 'F', 'N'))
      return {false, orientation[1] == 'F', orientation[0] == 'M'};
  }
  throw InputError(source, "image orientation is '" + orientation +
                               "', must be one of MF, UF, MN, UN, FM, FU, NM, NU");
}

void require_brightness(const IgsioSequence& sequence, const std::string& source) {
  // Older software records no type; its 8-bit data are brightness.
  const bool brightness = sequence.image_type.empty() || sequence.image_type == "BRIGHTNESS";
  if (!brightness || sequence.element != IgsioElement::kUint8)
    throw InputError(source,
                     "image type is '" + sequence.image_type +
                         (sequence.element == IgsioElement::kUint8 ? "', 8 bit" : "', 16 bit") +
                         ", must be BRIGHTNESS, 8 bit");
}

}  // namespace

bool is_igsio(const std::filesystem::path& path) {
  try {
    const io::Bytes bytes = io::read_prefix(path, kHeaderBytes);
    const std::string_view text = io::text_view(bytes);
    const std::string_view header = text.substr(0, text.find("\nElementDataFile"));
    return header.substr(0, 10) == "ObjectType" &&
           (header.find("\nSeq_Frame") != header.npos ||
            header.find("\nUltrasoundImage") != header.npos);
  } catch (const InputError&) {
    return false;
  }
}

IgsioSequence read_igsio(const std::filesystem::path& path) {
  return io::parse_igsio(io::read_bytes(path), path.string(), [&](const std::string& name) {
    return io::read_bytes(io::sibling_file(path, name, "ElementDataFile"));
  });
}

void write_igsio(const IgsioSequence& sequence, const std::filesystem::path& path,
                 bool compressed) {
  io::write_bytes(path, io::format_igsio(sequence, compressed, path.string()));
}

OrientedImage oriented_frame(const IgsioSequence& sequence, int frame,
                             const std::string& orientation, const std::string& source) {
  require_brightness(sequence, source);
  if (frame < 0 || static_cast<std::size_t>(frame) >= sequence.frames.size())
    throw InputError(source, "has " + std::to_string(sequence.frames.size()) + " frames, number " +
                                 std::to_string(frame) + " (from 0) was asked for");
  const InPlane from = parse_in_plane(sequence.orientation, source);
  const InPlane to = parse_in_plane(orientation, "requested frame");
  const bool transpose = from.lines_contiguous != to.lines_contiguous;
  OrientedImage image;
  image.width = transpose ? sequence.height : sequence.width;
  image.height = transpose ? sequence.width : sequence.height;
  image.pixels.reserve(sequence.frame_bytes());
  const std::uint8_t* pixels =
      sequence.data.data() + static_cast<std::size_t>(frame) * sequence.frame_bytes();
  const bool flip_depth = from.far != to.far;
  const bool flip_lateral = from.marked != to.marked;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      int source_x = transpose ? y : x;
      int source_y = transpose ? x : y;
      if (from.lines_contiguous ? flip_depth : flip_lateral)
        source_x = sequence.width - 1 - source_x;
      if (from.lines_contiguous ? flip_lateral : flip_depth)
        source_y = sequence.height - 1 - source_y;
      image.pixels.push_back(
          pixels[static_cast<std::size_t>(source_y) * static_cast<std::size_t>(sequence.width) +
                 static_cast<std::size_t>(source_x)]);
    }
  return image;
}

PreScanVolume to_prescan(const IgsioSequence& sequence, const ProbeConfig& probe,
                         const TrackedSweep& sweep, const std::string& source) {
  require_brightness(sequence, source);
  if (!parse_in_plane(sequence.orientation, source).lines_contiguous)
    throw InputError(source, "image orientation is '" + sequence.orientation +
                                 "', must be FM, FU, NM or NU (before scan conversion)");
  RecordedFrames recorded;
  recorded.samples = sequence.width;
  recorded.lines = sequence.height;
  recorded.frames = static_cast<int>(sequence.frames.size());
  PreScanVolume volume;
  volume.geometry = tracked_geometry(probe, recorded, sweep, source);
  volume.voxels.reserve(sequence.data.size());
  for (int frame = 0; frame < recorded.frames; ++frame) {
    const OrientedImage image = oriented_frame(sequence, frame, "FM", source);
    volume.voxels.insert(volume.voxels.end(), image.pixels.begin(), image.pixels.end());
  }
  return volume;
}

}  // namespace usct
