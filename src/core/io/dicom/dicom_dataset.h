#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

/// A strict parser of the structure of DICOM files (PS3.5, PS3.10). It reads only the attributes
/// that a caller asks for, and so never patient identifiers.
///
/// It replaces the parser of a library for two reasons. GDCM, as Debian builds it, ends the program
/// at some truncated files, and invents missing pixels in others. DCMTK 3.6.7 passes our tests of
/// truncation, but a file of 360 kB with 10,000 nested sequences overflows its stack and ends the
/// program, and it reads headers 1.5 times as slowly (docs/experiments/2026-11-22-dicom-parser.md).
namespace usct::io {

/// A DICOM attribute.
struct Attribute {
  const char* name;
  std::uint32_t tag;  // group << 16 | element
};

/// The wanted attributes of a file, or of an item of a sequence.
class DicomDataset {
 public:
  DicomDataset(std::string source, bool big_endian)
      : source_(std::move(source)), big_endian_(big_endian) {}

  const std::string& source() const { return source_; }
  bool has(const Attribute& attribute) const;

  /// The value without padding; empty if the attribute is missing.
  std::string text(const Attribute& attribute) const;
  /// The values of an attribute that holds several, separated by backslashes.
  std::vector<std::string> texts(const Attribute& attribute) const;

  /// The value of a decimal or integer string; empty if the attribute is missing or empty. Throw
  /// InputError, naming the attribute, for a value that is not `count` finite numbers.
  std::optional<std::vector<double>> find_numbers(const Attribute& attribute,
                                                  std::size_t count) const;
  std::optional<int> find_integer(const Attribute& attribute) const;

  /// The 16-bit value of an attribute of type US or SS, as unsigned.
  std::optional<std::uint16_t> find_short(const Attribute& attribute) const;
  int require_short(const Attribute& attribute) const;

  /// The items of a sequence; none if it is missing.
  const std::vector<DicomDataset>& items(const Attribute& attribute) const;

  [[noreturn]] void refuse(const Attribute& attribute, const std::string& value,
                           const std::string& constraint) const;
  [[noreturn]] void refuse_missing(const Attribute& attribute) const;

  /// Adds an element that the parser read. Returns false if the tag exists already.
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

/// Location of the pixels in the file: one range, or, if they are compressed, their fragments.
struct DicomPixelData {
  bool encapsulated = false;
  std::vector<ByteRange> ranges;
  /// The Basic Offset Table that precedes fragments; it may be empty.
  ByteRange offset_table;
};

struct DicomContent {
  std::string transfer_syntax_uid;
  bool big_endian = false;
  DicomDataset data;
  std::optional<DicomPixelData> pixels;
};

/// The attributes to read; the parser skips all others.
struct DicomWanted {
  std::vector<Attribute> values;
  std::vector<Attribute> sequences;
};

/// Parses a file up to its pixels, which it only locates. A file may lack the preamble of 128
/// bytes. Throws InputError, naming the file, the place and the fault, for anything that is not
/// well-formed.
DicomContent parse_dicom(const std::filesystem::path& path, const DicomWanted& wanted);

/// The SOP class that the file's meta information states, before the data set; empty if it states
/// none. Throws InputError if the meta information is not well-formed.
std::string stated_sop_class(const std::filesystem::path& path);

/// The bytes of a part of a file. Throws InputError if they cannot be read.
std::vector<std::uint8_t> read_range(const std::filesystem::path& path, const ByteRange& range);

}  // namespace usct::io
