#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/bytes.h"

namespace usct::fuzz {

/// A function that reads files from outside, and what it reads if all is well.
struct Reader {
  std::string name;
  /// Name of the file that is changed; its ending may choose the format.
  std::string file;
  /// Small valid files to begin with.
  std::vector<io::Bytes> seeds;
  /// Reads the file. May throw InputError only.
  std::function<void(const std::filesystem::path& path)> read;
  /// Files beside it that stay as they are, by name.
  std::map<std::string, io::Bytes> beside = {};
  /// Makes good again what a change would always break, so that readers get further than that: a
  /// checksum, a compressed stream. Applied to half of the files; null: nothing.
  io::Bytes (*mended)(const io::Bytes& bytes) = nullptr;
};

/// Every reader of the table of formats, and those of files that the table does not have: options,
/// calibrations, wire distances, the alignment that is kept. Needs a folder for the time of the
/// call, and the programs of dcmtk and gdcm for compressed DICOM files.
std::vector<Reader> readers_of_ct(const std::filesystem::path& folder);
std::vector<Reader> readers_of_ultrasound(const std::filesystem::path& folder);
std::vector<Reader> readers_of_results(const std::filesystem::path& folder);

/// The bytes that `write` writes to a file of this name.
io::Bytes written(const std::filesystem::path& folder, const std::string& name,
                  const std::function<void(const std::filesystem::path&)>& write);

inline io::Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

/// The file as `usct info` reads it.
void describe(const std::filesystem::path& path);

}  // namespace usct::fuzz
