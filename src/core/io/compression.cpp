#include "io/compression.h"

#include <zlib.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

constexpr std::uint64_t kLargestRatio = 1032;  // of deflate (zlib's technical notes)
constexpr std::size_t kChunk = std::size_t{1} << 20;
constexpr int kGzipWindow = MAX_WBITS + 16;

int window(Compression compression) {
  return compression == Compression::kGzip ? kGzipWindow : MAX_WBITS;
}

/// zlib counts bytes in 32 bits, so that larger data are passed in parts.
uInt zlib_count(std::size_t count) {
  return static_cast<uInt>(std::min<std::size_t>(count, std::numeric_limits<uInt>::max()));
}

class Inflater {
 public:
  Inflater(const Bytes& bytes, std::size_t offset, Compression compression) {
    stream_.next_in = const_cast<Bytef*>(bytes.data() + offset);  // zlib does not write to it
    remaining_ = bytes.size() - offset;
    if (inflateInit2(&stream_, window(compression)) != Z_OK)
      throw std::runtime_error("zlib could not be started");
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  /// Decompresses up to `count` bytes, fewer at the end of the data. Returns their number.
  std::size_t read(std::uint8_t* target, std::size_t count, const std::string& source) {
    std::size_t done = 0;
    while (done < count && !ended_) {
      const uInt given = zlib_count(remaining_);
      const uInt room = zlib_count(count - done);
      stream_.avail_in = given;
      stream_.next_out = target + done;
      stream_.avail_out = room;
      const int status = inflate(&stream_, Z_NO_FLUSH);
      remaining_ -= given - stream_.avail_in;
      done += room - stream_.avail_out;
      if (status == Z_STREAM_END)
        start_next_member();
      else if (status != Z_OK)
        throw InputError(
            source, remaining_ == 0 ? "compressed data end early" : "compressed data are damaged");
    }
    return done;
  }

 private:
  /// A gzip file is a sequence of members.
  void start_next_member() {
    constexpr std::uint8_t kGzipMagic = 0x1f;
    ended_ = remaining_ == 0 || *stream_.next_in != kGzipMagic || inflateReset(&stream_) != Z_OK;
  }

  z_stream stream_{};
  std::size_t remaining_;
  bool ended_ = false;
};

}  // namespace

Bytes decompress(const Bytes& bytes, std::size_t offset, std::uint64_t expected_size,
                 Compression compression, const std::string& source) {
  const std::uint64_t available = bytes.size() - offset;
  if (expected_size / kLargestRatio > available)
    throw InputError(source, "sizes ask for " + std::to_string(expected_size) + " bytes, which " +
                                 std::to_string(available) + " compressed bytes cannot hold");
  Inflater inflater(bytes, offset, compression);
  Bytes result;
  while (result.size() < expected_size) {
    const std::size_t begin = result.size();
    const std::uint64_t wanted =
        std::min<std::uint64_t>(expected_size - begin, std::max(begin, kChunk));
    result.resize(begin + static_cast<std::size_t>(wanted));
    const std::size_t got = inflater.read(result.data() + begin, result.size() - begin, source);
    if (got < wanted)
      throw InputError(source, "compressed data give " + std::to_string(begin + got) +
                                   " bytes, sizes ask for " + std::to_string(expected_size));
  }
  std::uint8_t extra = 0;
  if (inflater.read(&extra, 1, source) != 0)
    throw InputError(source, "compressed data give more than the " + std::to_string(expected_size) +
                                 " bytes that sizes ask for");
  return result;
}

Bytes compress(const Bytes& bytes, Compression compression) {
  z_stream stream{};
  constexpr int kMemoryLevel = 8;
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, window(compression), kMemoryLevel,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("zlib could not be started");
  Bytes result;
  std::size_t consumed = 0;
  int status = Z_OK;
  while (status == Z_OK) {
    const std::size_t begin = result.size();
    result.resize(begin + kChunk);
    const uInt given = zlib_count(bytes.size() - consumed);
    stream.next_in = const_cast<Bytef*>(bytes.data() + consumed);
    stream.avail_in = given;
    stream.next_out = result.data() + begin;
    stream.avail_out = static_cast<uInt>(kChunk);
    status = deflate(&stream, consumed + given == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    consumed += given - stream.avail_in;
    result.resize(begin + kChunk - stream.avail_out);
  }
  deflateEnd(&stream);
  if (status != Z_STREAM_END) throw std::runtime_error("compression failed");
  return result;
}

}  // namespace usct::io
