#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

/// The table of file formats. One row holds everything that a command needs to know of a format;
/// docs/file_formats.md describes the files themselves. A new format is a new row.
namespace usct {

/// Kinds of content of a file. A command treats all formats of one content alike.
enum class FileContent { kCtSeries, kVolume, kUltrasound, kTransform, kResult, kPoints, kProbe };

/// Functions that read, and possibly write, files of a format as ultrasound.
struct UltrasoundFormat {
  /// Reads the file. Throws InputError; the options below have been checked before.
  UltrasoundInput (*read)(const UltrasoundSource& source) = nullptr;

  /// Options without which no file of the format can be read.
  std::vector<UltrasoundField> needed_options;
  /// Further options that files of the format can use. All other options are refused.
  std::vector<UltrasoundField> usable_options;
  /// Reason why other options are refused, for messages: "it holds its own geometry".
  std::string refusal;

  /// File name ending of files that `write` makes; empty if the format is only read.
  std::string written_ending;
  /// Writes beams before scan conversion, atomically. Throws InputError for a volume that the
  /// format cannot hold.
  void (*write)(const PreScanVolume& volume, const std::filesystem::path& path) = nullptr;

  bool can_use(const UltrasoundField& option) const;
  bool needs(const UltrasoundField& option) const;
};

struct FileFormat {
  /// Name for users: "DICOM series", "pre-scan ultrasound (NRRD)".
  std::string name;
  FileContent content;

  /// A file is of this format if its name has one of these endings (in lower case; the case of the
  /// name does not matter), or if `recognises` says so. A damaged file with the right ending thus
  /// gets an error from its reader. `recognises` throws nothing; it may be null.
  std::vector<std::string> endings;
  bool (*recognises)(const std::filesystem::path& path) = nullptr;

  /// The output of `usct info` for a file: a JSON object as text, keys in reading order with units
  /// in their names, and `warnings` (a list of texts). The whole file is read, so that the range of
  /// values is known and damage is found. Throws InputError as the reader does.
  std::string (*describe)(const std::filesystem::path& path) = nullptr;

  /// Empty if files of the format are not ultrasound.
  std::optional<UltrasoundFormat> ultrasound;
};

/// All formats, in the order in which they claim a file: the first row that matches wins.
const std::vector<FileFormat>& file_formats();

/// The format of a file or folder. Throws InputError if the path does not exist, cannot be read, is
/// an empty file, or is of no format in the table.
const FileFormat& detect_format(const std::filesystem::path& path);

/// Throws InputError if options of `source` contradict each other, if one is missing that the
/// format needs, or if one is given that the format cannot use. `read_ultrasound` does this itself.
void check_ultrasound_options(const UltrasoundSource& source, const FileFormat& format);

}  // namespace usct
