#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "us_ct_registration/rendering/surface.h"

/// Surfaces as files of other programs.
namespace usct {

/// Writes a binary PLY or STL file, by the extension of `path` (.ply or .stl), with the points as
/// they are (LPS mm for a surface of a CT; 32-bit floats). The header says SPACE=LPS, as 3D Slicer
/// reads it, the unit, and `name`. `colour` is red, green and blue in [0, 1] of all points; STL has
/// no colours. The file is complete or absent.
///
/// Throws InputError, naming `path`, for another extension, a surface without triangles, and a
/// folder that cannot be written to.
void write_surface(const Surface& surface, const std::string& name,
                   const std::optional<std::array<float, 3>>& colour,
                   const std::filesystem::path& path);

/// Throws the InputError of `write_surface` if the extension of `path` is not .ply or .stl.
void require_surface_extension(const std::filesystem::path& path);

}  // namespace usct
