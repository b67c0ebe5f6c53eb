#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <string_view>

#include "io/dicom/dicom_dataset.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kUndefinedLength = 0xffffffff;
constexpr std::uint32_t kItem = 0xfffee000;
constexpr std::uint32_t kItemEnd = 0xfffee00d;
constexpr std::uint32_t kSequenceEnd = 0xfffee0dd;
constexpr std::uint32_t kPixelDataTag = 0x7fe00010;
const Attribute kMediaStorageSopClass{"MediaStorageSOPClassUID", 0x00020002};
const Attribute kTransferSyntax{"TransferSyntaxUID", 0x00020010};
constexpr std::uint64_t kPreambleBytes = 128;
/// Values of the attributes that are read are shorter than this.
constexpr std::uint32_t kLongestValue = 1 << 16;
constexpr int kDeepestNesting = 32;

/// Random access to the bytes of a file. A window is read at a time, so that a header is read
/// without its pixels.
class FileBytes {
 public:
  explicit FileBytes(const fs::path& path) : source_(path.string()), file_(path, std::ios::binary) {
    std::error_code error;
    size_ = fs::file_size(path, error);
    if (!file_ || error) throw InputError(source_, "cannot be opened");
  }

  const std::string& source() const { return source_; }
  std::uint64_t size() const { return size_; }

  /// Copies `count` bytes from `begin` on. The caller must have checked that the file holds them.
  void read(std::uint64_t begin, void* out, std::size_t count) {
    if (begin < window_begin_ || begin + count > window_begin_ + window_.size())
      move_window(begin, count);
    std::memcpy(out, window_.data() + (begin - window_begin_), count);
  }

 private:
  void move_window(std::uint64_t begin, std::size_t count) {
    constexpr std::uint64_t kWindow = 16384;
    const std::uint64_t wanted = std::max<std::uint64_t>(count, kWindow);
    window_.resize(static_cast<std::size_t>(std::min(wanted, size_ - begin)));
    window_begin_ = begin;
    file_.seekg(static_cast<std::streamoff>(begin));
    file_.read(window_.data(), static_cast<std::streamsize>(window_.size()));
    if (!file_) throw InputError(source_, "could not be read to its end");
  }

  std::string source_;
  std::ifstream file_;
  std::uint64_t size_ = 0;
  std::vector<char> window_;
  std::uint64_t window_begin_ = 0;
};

/// The encoding of elements, as the transfer syntax states it.
struct Encoding {
  bool explicit_vr;
  bool big_endian;
};

std::string tag_text(std::uint32_t tag) {
  return formatted("(%04x,%04x)", tag >> 16, tag & 0xffff);
}

bool holds(const std::vector<Attribute>& attributes, std::uint32_t tag) {
  return std::any_of(attributes.begin(), attributes.end(),
                     [tag](const Attribute& a) { return a.tag == tag; });
}

/// Whether the length of this value representation takes 4 bytes (after 2 reserved bytes), not 2.
bool has_long_form(std::string_view vr) {
  constexpr std::array<std::string_view, 13> kLong = {"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                      "SV", "UC", "UN", "UR", "UT", "UV"};
  return std::find(kLong.begin(), kLong.end(), vr) != kLong.end();
}

class Parser {
 public:
  Parser(FileBytes& file, const DicomWanted& wanted, Encoding encoding, std::uint64_t begin)
      : file_(file), wanted_(wanted), encoding_(encoding), at_(begin) {}

  std::uint64_t at() const { return at_; }

  /// The group of the next element; empty at the end of the file.
  std::optional<std::uint16_t> next_group() {
    if (at_ == file_.size()) return std::nullopt;
    require(2, "a tag");
    const std::uint64_t begin = at_;
    const std::uint16_t group = read_short();
    at_ = begin;
    return group;
  }

  /// Parses elements up to the pixels, or to the end of the file.
  void parse_top(DicomDataset& data, std::optional<DicomPixelData>& pixels) {
    while (next_group()) {
      const Header header = read_header();
      if (header.tag == kPixelDataTag) {
        pixels = parse_pixels(header);
        return;
      }
      parse_value(header, &data, 0);
    }
  }

  /// Parses elements as long as they belong to the group.
  void parse_group(std::uint16_t group, DicomDataset& data) {
    while (next_group() == group) parse_value(read_header(), &data, 0);
  }

 private:
  struct Header {
    std::uint32_t tag;
    std::array<char, 2> vr;  // value representation; blanks if it is implicit
    std::uint32_t length;
    std::uint64_t place;

    std::string_view vr_text() const { return {vr.data(), 2}; }
  };

  [[noreturn]] void refuse(std::uint64_t place, const std::string& what) const {
    throw InputError(file_.source(), what + " at byte " + std::to_string(place) +
                                         ": the file is cut short or damaged");
  }

  void require(std::uint64_t count, const std::string& what) const {
    if (count > file_.size() - at_)
      refuse(at_, what + " of " + std::to_string(count) + " bytes goes beyond the end of the file");
  }

  std::uint16_t read_short() {
    std::uint8_t b[2];
    file_.read(at_, b, 2);
    at_ += 2;
    return static_cast<std::uint16_t>(encoding_.big_endian ? b[0] << 8 | b[1] : b[1] << 8 | b[0]);
  }

  std::uint32_t read_long() {
    const std::uint32_t first = read_short();
    const std::uint32_t second = read_short();
    return encoding_.big_endian ? first << 16 | second : second << 16 | first;
  }

  Header read_header() {
    Header header{0, {' ', ' '}, 0, at_};
    require(8, "the header of an element");
    const std::uint32_t group = read_short();
    header.tag = group << 16 | read_short();
    const bool delimiter = group == 0xfffe;  // delimiters have no value representation
    if (!encoding_.explicit_vr || delimiter) {
      header.length = read_long();
      return header;
    }
    file_.read(at_, header.vr.data(), 2);
    at_ += 2;
    const auto is_letter = [](char c) { return c >= 'A' && c <= 'Z'; };
    if (!is_letter(header.vr[0]) || !is_letter(header.vr[1]))
      refuse(header.place,
             tag_text(header.tag) + " has the value representation " + in_quotes(header.vr_text()));
    header.length = read_short();
    if (!has_long_form(header.vr_text())) return header;
    require(4, "the length of " + tag_text(header.tag));
    header.length = read_long();
    return header;
  }

  /// Keeps the value in `data` if it is wanted, and moves behind it.
  void parse_value(const Header& header, DicomDataset* data, int depth) {
    if (header.tag >> 16 == 0xfffe)
      refuse(header.place, "delimiter " + tag_text(header.tag) + " without a sequence");
    const bool undefined = header.length == kUndefinedLength;
    if (!undefined) require(header.length, "the value of " + tag_text(header.tag));
    // An icon, say, holds compressed pixels of its own, as fragments and not as items with
    // elements.
    if (undefined &&
        (header.tag == kPixelDataTag || header.vr_text() == "OB" || header.vr_text() == "OW")) {
      parse_pixels(header);
      return;
    }
    if (undefined || (data != nullptr && holds(wanted_.sequences, header.tag))) {
      parse_sequence(header, data, depth);
      return;
    }
    if (data != nullptr && holds(wanted_.values, header.tag)) {
      if (header.length > kLongestValue)
        refuse(header.place, tag_text(header.tag) + " has " + std::to_string(header.length) +
                                 " bytes, more than any value of it");
      std::string value(header.length, '\0');
      file_.read(at_, value.data(), value.size());
      if (!data->add(header.tag, std::move(value)))
        refuse(header.place, tag_text(header.tag) + " is there twice,");
    }
    at_ += header.length;
  }

  void parse_sequence(const Header& header, DicomDataset* data, int depth) {
    if (depth >= kDeepestNesting) refuse(header.place, "more than 32 nested sequences");
    const bool keep = data != nullptr && holds(wanted_.sequences, header.tag);
    const Encoding outer = encoding_;
    // PS3.5 6.2.2: a program that does not know a sequence writes it as UN, with implicit value
    // representations inside.
    if (header.vr_text() == "UN") encoding_ = {false, false};
    std::vector<DicomDataset> items;
    const std::uint64_t end = end_of(header);
    bool closed = header.length != kUndefinedLength;
    while (at_ < end) {
      const Header item = read_header();
      closed |= item.tag == kSequenceEnd;
      if (item.tag == kSequenceEnd && header.length == kUndefinedLength) break;
      if (item.tag != kItem)
        refuse(item.place, tag_text(item.tag) + " where an item of a sequence must begin,");
      items.emplace_back(file_.source(), encoding_.big_endian);
      parse_item(item, keep ? &items.back() : nullptr, depth + 1);
      if (!keep) items.clear();
    }
    if (!closed) refuse(at_, "a sequence without its end");
    if (header.length != kUndefinedLength && at_ != end)
      refuse(header.place, "the items of " + tag_text(header.tag) + " are longer than it");
    encoding_ = outer;
    if (keep && !data->add(header.tag, std::move(items)))
      refuse(header.place, tag_text(header.tag) + " is there twice,");
  }

  void parse_item(const Header& item, DicomDataset* data, int depth) {
    if (item.length != kUndefinedLength) require(item.length, "an item of a sequence");
    const std::uint64_t end = end_of(item);
    while (at_ < end) {
      const Header header = read_header();
      if (header.tag == kItemEnd && item.length == kUndefinedLength) return;
      parse_value(header, data, depth);
    }
    if (item.length == kUndefinedLength) refuse(at_, "an item without its end");
    if (at_ != end) refuse(item.place, "the elements of an item are longer than it");
  }

  std::uint64_t end_of(const Header& header) const {
    return header.length == kUndefinedLength ? file_.size() : at_ + header.length;
  }

  DicomPixelData parse_pixels(const Header& header) {
    DicomPixelData pixels;
    if (header.length != kUndefinedLength) {
      require(header.length, "the value of 'PixelData'");
      pixels.ranges.push_back({at_, header.length});
      return pixels;
    }
    pixels.encapsulated = true;
    while (true) {
      const Header item = read_header();
      if (item.tag == kSequenceEnd) break;
      if (item.tag != kItem || item.length == kUndefinedLength)
        refuse(item.place, tag_text(item.tag) + " where a fragment of 'PixelData' must begin,");
      require(item.length, "a fragment of 'PixelData'");
      pixels.ranges.push_back({at_, item.length});
      at_ += item.length;
    }
    if (pixels.ranges.empty()) refuse(header.place, "'PixelData' without its table of offsets");
    pixels.offset_table = pixels.ranges.front();
    pixels.ranges.erase(pixels.ranges.begin());
    return pixels;
  }

  FileBytes& file_;
  const DicomWanted& wanted_;
  Encoding encoding_;
  std::uint64_t at_;
};

std::uint64_t begin_of_elements(FileBytes& file) {
  char magic[4] = {};
  if (file.size() >= kPreambleBytes + 4) file.read(kPreambleBytes, magic, 4);
  return std::memcmp(magic, "DICM", 4) == 0 ? kPreambleBytes + 4 : 0;
}

Encoding encoding_of(const std::string& transfer_syntax_uid, const std::string& source) {
  if (transfer_syntax_uid == "1.2.840.10008.1.2") return {false, false};
  if (transfer_syntax_uid == "1.2.840.10008.1.2.2") return {true, true};
  if (transfer_syntax_uid == "1.2.840.10008.1.2.1.99" || transfer_syntax_uid.empty())
    throw InputError(source, "'TransferSyntaxUID' is " + in_quotes(transfer_syntax_uid) +
                                 ", must be one that is read (a deflated data set is not)");
  return {true, false};  // PS3.5 A.4: every transfer syntax that compresses pixels
}

/// The elements of group 2, which say how the others are encoded. A file may lack them.
struct MetaInformation {
  DicomDataset data;
  std::uint64_t begin;
  std::uint64_t end;
};

MetaInformation parse_meta(FileBytes& file) {
  static const DicomWanted wanted{{kMediaStorageSopClass, kTransferSyntax}, {}};
  const std::uint64_t begin = begin_of_elements(file);
  Parser parser(file, wanted, {true, false}, begin);
  DicomDataset data(file.source(), false);
  parser.parse_group(2, data);
  return {std::move(data), begin, parser.at()};
}

/// Guesses the transfer syntax of a file that does not state it: it is explicit if the letters of a
/// value representation follow the first tag.
std::string guessed_syntax(FileBytes& file, std::uint64_t begin) {
  char vr[2] = {};
  if (file.size() >= begin + 6) file.read(begin + 4, vr, 2);
  const bool letters = vr[0] >= 'A' && vr[0] <= 'Z' && vr[1] >= 'A' && vr[1] <= 'Z';
  return letters ? "1.2.840.10008.1.2.1" : "1.2.840.10008.1.2";
}

}  // namespace

DicomContent parse_dicom(const fs::path& path, const DicomWanted& wanted) {
  FileBytes file(path);
  const MetaInformation meta = parse_meta(file);
  const bool stated = meta.end > meta.begin;
  std::string syntax = stated ? meta.data.text(kTransferSyntax) : guessed_syntax(file, meta.end);
  const Encoding encoding = encoding_of(syntax, path.string());
  DicomContent content{std::move(syntax), encoding.big_endian,
                       DicomDataset(path.string(), encoding.big_endian), std::nullopt};
  Parser(file, wanted, encoding, meta.end).parse_top(content.data, content.pixels);
  return content;
}

std::string stated_sop_class(const fs::path& path) {
  FileBytes file(path);
  return parse_meta(file).data.text(kMediaStorageSopClass);
}

std::vector<std::uint8_t> read_range(const fs::path& path, const ByteRange& range) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(range.begin));
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(range.length));
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) throw InputError(path.string(), "could not be read to its end");
  return bytes;
}

}  // namespace usct::io
