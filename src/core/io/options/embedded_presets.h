#pragma once

#include <map>
#include <string>

namespace usct::io {

/// The files of config/presets/ by name, as they were when the library was built.
const std::map<std::string, std::string>& embedded_presets();

}  // namespace usct::io
