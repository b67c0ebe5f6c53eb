#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

/// The structure of DICOM files (PS3.5, PS3.10), strictly.
///
/// Not GDCM's parser: Debian builds GDCM with its assertions, so that a file that is cut short ends
/// the program, and where it does not, missing pixels are made up. This one also never takes in
/// what it is not asked for, patient identifiers among it.
namespace usct::io {

/// A DICOM attribute that this code reads.
struct Attribute {
  const char* name;
  std::uint32_t tag;  // group << 16 | element
};

/// The attributes of a file, or of an item of a sequence, that were asked for.
class DicomDataset {
 public:
  DicomDataset(std::string source, bool big_endian)
      : source_(std::move(source)), big_endian_(big_endian) {}

  const std::string& source() const { return source_; }
  bool has(const Attribute& attribute) const;

  /// Without padding; empty if there is none.
  std::string text(const Attribute& attribute) const;
  /// The parts between backslashes.
  std::vector<std::string> texts(const Attribute& attribute) const;

  /// Decimal or integer strings; nothing if missing or empty. Throw InputError, naming the
  /// attribute, if it is there and is not `count` finite numbers.
  std::optional<std::vector<double>> find_numbers(const Attribute& attribute,
                                                  std::size_t count) const;
  std::optional<int> find_integer(const Attribute& attribute) const;

  /// The 16-bit value of an attribute of US or SS, as unsigned.
  std::optional<std::uint16_t> find_short(const Attribute& attribute) const;
  int require_short(const Attribute& attribute) const;

  /// The items of a sequence; none if it is not there.
  const std::vector<DicomDataset>& items(const Attribute& attribute) const;

  [[noreturn]] void refuse(const Attribute& attribute, const std::string& value,
                           const std::string& constraint) const;
  [[noreturn]] void refuse_missing(const Attribute& attribute) const;

  /// For the parser. False if the tag is there already.
  bool add(std::uint32_t tag, std::string value) {
    return values_.emplace(tag, std::move(value)).second;
  }
  bool add(std::uint32_t tag, std::vector<DicomDataset> items) {
    return sequences_.emplace(tag, std::move(items)).second;
  }

 private:
  std::string source_;
  bool big_endian_;
  std::map<std::uint32_t, std::string> values_;
  std::map<std::uint32_t, std::vector<DicomDataset>> sequences_;
};

/// Part of a file.
struct ByteRange {
  std::uint64_t begin = 0;
  std::uint64_t length = 0;
};

/// Where the pixels are: all in one range, or, if compressed, in fragments (without the table of
/// offsets that comes first).
struct DicomPixelData {
  bool encapsulated = false;
  std::vector<ByteRange> ranges;
};

struct DicomContent {
  std::string transfer_syntax_uid;
  bool big_endian = false;
  DicomDataset data;
  std::optional<DicomPixelData> pixels;
};

/// What of a file is wanted; all else is passed over.
struct DicomWanted {
  std::vector<Attribute> values;
  std::vector<Attribute> sequences;
};

/// Up to the pixels and their place. Files without the preamble of 128 bytes are read as well.
/// Throws InputError, naming the file, the place and what is wrong, for anything that is not
/// well-formed.
DicomContent parse_dicom(const std::filesystem::path& path, const DicomWanted& wanted);

/// The bytes of a part of a file. Throws InputError if they cannot be read.
std::vector<std::uint8_t> read_range(const std::filesystem::path& path, const ByteRange& range);

}  // namespace usct::io
