#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "us_ct_registration/rendering/surface.h"

namespace usct {

/// PLY files by VTK, a module (module.h).
struct PlyFiles {
  static constexpr const char* kModule = "ply";

  /// Writes a surface of at least one triangle, atomically. `name` is one line.
  void (*write)(const Surface& surface, const std::string& name,
                const std::optional<std::array<float, 3>>& colour,
                const std::filesystem::path& path);
};

}  // namespace usct
