#pragma once

#include <filesystem>
#include <string>

namespace usct::io {

/// The path of the detached data file that a header names. It must be in the header's folder (that
/// of the file behind it, if the header is a link), and no link to another folder: if a name could
/// hold a path, a foreign header could make the reader open any file of the machine. Throws
/// InputError, naming the header and `field`, also if the file is missing, empty or not readable.
std::filesystem::path sibling_file(const std::filesystem::path& header, const std::string& name,
                                   const std::string& field);

}  // namespace usct::io
