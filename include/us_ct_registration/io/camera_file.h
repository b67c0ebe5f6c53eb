#pragma once

#include <filesystem>

#include "us_ct_registration/geometry/camera.h"

namespace usct {

/// Reads the intrinsics of a camera from a YAML file as ROS' camera_calibration writes it:
/// `image_width`, `image_height`, `camera_matrix`, `distortion_model` (plumb_bob or
/// rational_polynomial) and `distortion_coefficients`. Rectification and projection are not used:
/// the camera is that of raw images.
///
/// Throws InputError, naming the file and the key: if it is not such a file, or as `Camera`.
Camera read_camera(const std::filesystem::path& path);

}  // namespace usct
