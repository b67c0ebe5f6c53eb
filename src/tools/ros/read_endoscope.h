#pragma once

#include <filesystem>

#include "ros/bags/endoscope_video.h"

namespace usct::tools {

/// The video in a folder that `usct phantom --endoscope` wrote. Throws InputError, naming the file,
/// if one is missing or not as expected.
ros_interface::EndoscopeVideo read_endoscope(const std::filesystem::path& folder);

}  // namespace usct::tools
