#include "io/dicom/dicom_codecs.h"

#include <algorithm>
#include <array>
#include <optional>

#include "io/dicom/gdcm_codecs.h"
#include "module.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

using Bytes = std::vector<std::uint8_t>;

enum class Codec { kJpeg, kJpegLs, kJpeg2000, kRle };

struct Syntax {
  const char* uid;
  Codec codec;
};
constexpr Syntax kSyntaxes[] = {{"1.2.840.10008.1.2.4.50", Codec::kJpeg},  // baseline
                                {"1.2.840.10008.1.2.4.51", Codec::kJpeg},  // extended, 12 bit
                                {"1.2.840.10008.1.2.4.57", Codec::kJpeg},  // lossless
                                {"1.2.840.10008.1.2.4.70", Codec::kJpeg},  // lossless, first order
                                {"1.2.840.10008.1.2.4.80", Codec::kJpegLs},    // lossless
                                {"1.2.840.10008.1.2.4.81", Codec::kJpegLs},    // near lossless
                                {"1.2.840.10008.1.2.4.90", Codec::kJpeg2000},  // lossless
                                {"1.2.840.10008.1.2.4.91", Codec::kJpeg2000},
                                {"1.2.840.10008.1.2.5", Codec::kRle}};

/// The format that the header of a stream of the JPEG family states.
struct StreamFormat {
  int columns = 0;
  int rows = 0;
  int components = 0;
  int bits = 0;
  bool is_signed = false;
};

int big_endian_16(const Bytes& bytes, std::size_t at) { return bytes[at] << 8 | bytes[at + 1]; }

/// A stream whose headers are well-formed.
struct CheckedStream {
  StreamFormat format;
  Bytes bytes;
};

/// Checks a JPEG or JPEG-LS stream: up to the first scan it consists of segments, each of which
/// begins with FF, a marker and a length. The result lacks the segments of applications: they do
/// not matter for a monochrome image, and some of them make GDCM end the program.
std::optional<CheckedStream> check_jpeg(const Bytes& stream) {
  constexpr int kScan = 0xda;
  if (stream.size() < 2 || stream[0] != 0xff || stream[1] != 0xd8) return std::nullopt;
  CheckedStream checked{{}, {0xff, 0xd8}};
  std::size_t at = 2;
  while (at + 4 <= stream.size() && stream[at] == 0xff) {
    const int marker = stream[at + 1];
    const std::size_t end = at + 2 + static_cast<std::size_t>(big_endian_16(stream, at + 2));
    const bool application = (marker >= 0xe0 && marker <= 0xef) || marker == 0xfe;
    const bool tables = marker == 0xc4 || marker == 0xdb || marker == 0xdd || marker == 0xf8;
    const bool frame =
        ((marker & 0xf0) == 0xc0 && marker != 0xc4 && marker != 0xc8) || marker == 0xf7;
    if (end > stream.size() || end < at + 4) return std::nullopt;
    if (marker == kScan) {
      if (checked.format.components == 0) return std::nullopt;
      checked.bytes.insert(checked.bytes.end(), stream.begin() + static_cast<std::ptrdiff_t>(at),
                           stream.end());
      return checked;
    }
    if (frame && end >= at + 10)
      checked.format = {big_endian_16(stream, at + 7), big_endian_16(stream, at + 5),
                        stream[at + 9], stream[at + 4], false};
    else if (!tables && !application)
      return std::nullopt;
    if (!application)
      checked.bytes.insert(checked.bytes.end(), stream.begin() + static_cast<std::ptrdiff_t>(at),
                           stream.begin() + static_cast<std::ptrdiff_t>(end));
    at = end;
  }
  return std::nullopt;
}

/// Checks a JPEG 2000 stream, whose first segment, SIZ, states the size.
std::optional<CheckedStream> check_jpeg_2000(const Bytes& stream) {
  constexpr std::array<std::uint8_t, 4> kBegin = {0xff, 0x4f, 0xff, 0x51};
  constexpr std::size_t kThroughFirstComponent = 43;
  if (stream.size() < kThroughFirstComponent ||
      !std::equal(kBegin.begin(), kBegin.end(), stream.begin()))
    return std::nullopt;
  const auto number = [&](std::size_t at) {
    return static_cast<std::int64_t>(big_endian_16(stream, at)) << 16 |
           big_endian_16(stream, at + 2);
  };
  const std::int64_t columns = number(8) - number(16);
  const std::int64_t rows = number(12) - number(20);
  if (columns != static_cast<int>(columns) || rows != static_cast<int>(rows)) return std::nullopt;
  return CheckedStream{{static_cast<int>(columns), static_cast<int>(rows),
                        big_endian_16(stream, 40), (stream[42] & 0x7f) + 1, stream[42] >> 7 == 1},
                       stream};
}

/// Whether the stream is complete. Codecs decode the rest of a truncated stream without an error;
/// every complete stream of the JPEG family ends with this marker.
bool has_end_marker(const Bytes& stream) {
  std::size_t size = stream.size();
  while (size > 0 && stream[size - 1] == 0) --size;  // padding to an even length
  return size >= 2 && stream[size - 2] == 0xff && stream[size - 1] == 0xd9;
}

CheckedStream check_stream(const std::string& source, Codec codec, const FrameFormat& format,
                           const Bytes& stream) {
  std::optional<CheckedStream> checked =
      codec == Codec::kJpeg2000 ? check_jpeg_2000(stream) : check_jpeg(stream);
  if (!checked || !has_end_marker(stream))
    throw InputError(source, std::string("compressed pixels have no ") +
                                 (checked ? "end" : "well-formed beginning") +
                                 ": cut short or damaged");
  const StreamFormat& found = checked->format;
  if (found.columns != format.columns || found.rows != format.rows || found.components != 1 ||
      found.bits > format.bits_allocated)
    throw InputError(source,
                     "compressed pixels are " + std::to_string(found.columns) + " x " +
                         std::to_string(found.rows) + " of " + std::to_string(found.components) +
                         " component(s), " + std::to_string(found.bits) + " bits, must be " +
                         std::to_string(format.columns) + " x " + std::to_string(format.rows) +
                         " of 1, <= " + std::to_string(format.bits_allocated) +
                         " bits as the header says");
  // The reverse is known of some writers: a stream that is said to be unsigned holds the two's
  // complement of signed values, which the header then says.
  if (found.is_signed && !format.is_signed)
    throw InputError(source,
                     "'PixelRepresentation' is 0, must be 1 as the compressed pixels are signed");
  return std::move(*checked);
}

/// Decodes one segment (PS3.5 G.3.1). Returns false unless it gives exactly `count` bytes.
bool unpack_bits(const std::uint8_t* in, const std::uint8_t* end, std::uint8_t* out,
                 std::size_t count, std::size_t stride) {
  std::size_t done = 0;
  while (done < count && in < end) {
    const int control = static_cast<std::int8_t>(*in++);
    if (control == -128) continue;
    const auto length = static_cast<std::size_t>(control >= 0 ? control + 1 : 1 - control);
    const std::size_t taken = control >= 0 ? length : 1;
    if (length > count - done || taken > static_cast<std::size_t>(end - in)) return false;
    for (std::size_t i = 0; i < length; ++i) out[(done + i) * stride] = in[control >= 0 ? i : 0];
    in += taken;
    done += length;
  }
  return done == count;
}

/// Decodes a frame by PS3.5 annex G: one segment per byte of a pixel, the most significant byte
/// first.
Bytes decompress_rle(const std::string& source, const FrameFormat& format, const Bytes& stream) {
  constexpr std::size_t kHeaderBytes = 64;
  const auto damaged = [&] {
    throw InputError(source, "pixels compressed by RLE are cut short or damaged");
  };
  const auto number = [&](std::size_t i) {
    return static_cast<std::size_t>(stream[4 * i]) |
           static_cast<std::size_t>(stream[4 * i + 1]) << 8 |
           static_cast<std::size_t>(stream[4 * i + 2]) << 16 |
           static_cast<std::size_t>(stream[4 * i + 3]) << 24;
  };
  const auto segments = static_cast<std::size_t>(format.bits_allocated / 8);
  if (stream.size() < kHeaderBytes || number(0) != segments) damaged();
  Bytes out(format.bytes());
  for (std::size_t s = 0; s < segments; ++s) {
    const std::size_t begin = number(1 + s);
    const std::size_t end = s + 1 < segments ? number(2 + s) : stream.size();
    if (begin < kHeaderBytes || begin > end || end > stream.size() ||
        !unpack_bits(&stream[0] + begin, &stream[0] + end, &out[segments - 1 - s],
                     out.size() / segments, segments))
      damaged();
  }
  return out;
}

}  // namespace

std::vector<std::uint8_t> decompress_frame(const std::string& source,
                                           const std::string& transfer_syntax_uid,
                                           const FrameFormat& format, const Bytes& stream) {
  const auto* syntax = std::find_if(std::begin(kSyntaxes), std::end(kSyntaxes),
                                    [&](const Syntax& s) { return transfer_syntax_uid == s.uid; });
  if (syntax == std::end(kSyntaxes))
    throw InputError(source, "'TransferSyntaxUID' is " + in_quotes(transfer_syntax_uid) +
                                 ", must be uncompressed, JPEG, JPEG-LS, JPEG 2000 or RLE");
  // Two bytes of RLE decode to at most 128, which bounds the size that a header may claim. The
  // other streams state their size themselves.
  if (syntax->codec == Codec::kRle) {
    if (format.bytes() / 64 > stream.size())
      throw InputError(source, "pixels compressed by RLE are cut short or damaged");
    return decompress_rle(source, format, stream);
  }
  const CheckedStream checked = check_stream(source, syntax->codec, format, stream);
  const bool is_jpeg_12 = syntax->codec == Codec::kJpeg && checked.format.bits == 12;
  const std::optional<Bytes> values =
      module<GdcmCodecs>().decode(transfer_syntax_uid, format, is_jpeg_12, checked.bytes);
  if (!values) throw InputError(source, "compressed pixels cannot be decoded: damaged");
  return *values;
}

}  // namespace usct::io
