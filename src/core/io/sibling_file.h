#pragma once

#include <filesystem>
#include <string>

namespace usct::io {

/// The detached data file that a header names. It must stand in the header's folder: a path would
/// let a foreign header read any file of this machine. Throws InputError, naming `field`.
std::filesystem::path sibling_file(const std::filesystem::path& header, const std::string& name,
                                   const std::string& field);

}  // namespace usct::io
