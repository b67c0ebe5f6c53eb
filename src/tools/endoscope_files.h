#pragma once

#include <filesystem>

#include "us_ct_registration/phantom/endoscope.h"
#include "us_ct_registration/progress.h"

namespace usct::tools {

/// Renders the video of an endoscope into a new folder:
///
/// | file | content |
/// |---|---|
/// | `camera.yaml` | intrinsics of both cameras, as ROS' camera_calibration writes them |
/// | `left_0000.png`, `right_0000.png`, ... | the images |
/// | `left_tumour_0000.png`, ... | white where the line of sight meets the tumour: the truth |
/// | `endoscope.json` | version, options, tumour, and the times and true poses of all frames |
void write_endoscope(const phantom::Endoscope& endoscope, const std::filesystem::path& folder,
                     const Progress& progress);

}  // namespace usct::tools
