#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

namespace usct::tools {

/// What `usct info` says of a file: keys with units in their names, in reading order, and
/// `warnings` (a list of texts). Reads the whole file, so that the range is known and damage shows.
/// Throws InputError as the readers do.
nlohmann::ordered_json describe(const std::filesystem::path& path);

}  // namespace usct::tools
