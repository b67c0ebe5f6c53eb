#pragma once

#include <CLI/CLI.hpp>

#include "tools/commands.h"

namespace usct::tools {

/// `usct bag video`: the images of a topic as a video and as a picture.
void add_video_command(CLI::App& bag, Run& run);

}  // namespace usct::tools
