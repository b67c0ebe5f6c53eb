#pragma once

#include <filesystem>
#include <string>

namespace usct {

/// The files of this project; docs/file_formats.md describes each.
enum class FileKind {
  kDicom,       // a folder, or one file of a series
  kVolume,      // NRRD, MetaImage or NIfTI
  kPreScan,     // the project's own pre-scan NRRD
  kIgsio,       // tracked sequence of Plus / IGSIO
  kUltrasonix,  // .bpr family
  kPropello,    // .vol
  kTransform,   // ITK transform
  kResult,      // registration result, JSON
  kPoints,      // CSV
  kProbe,       // probe YAML
};

/// For people: "DICOM series", "pre-scan ultrasound (NRRD)", ...
std::string file_kind_name(FileKind kind);

/// What a path holds, by content where that tells and by extension otherwise. Throws InputError if
/// it does not exist, cannot be read or is none of the kinds above.
FileKind detect_file_kind(const std::filesystem::path& path);

}  // namespace usct
