#pragma once

#include <array>
#include <filesystem>
#include <string>

/// ITK transform files as plain numbers, by modules (module.h): HDF5 loads more than all the rest.
/// ITK's headers include its own copy of Eigen, which cannot be included in one translation unit
/// with the system's Eigen.
namespace usct::io {

/// The map p -> matrix * p + translation.
struct LinearMap {
  std::array<std::array<double, 3>, 3> matrix;  // rows
  std::array<double, 3> translation;
  std::string type;  // ITK's name of the transform
};

struct TransformFiles {
  /// Reads a file with one linear transform. Throws InputError for anything else.
  LinearMap (*read)(const std::filesystem::path& path);
  /// Writes an AffineTransform in double precision, atomically.
  void (*write)(const LinearMap& map, const std::filesystem::path& path);
};

struct TextTransformFiles : TransformFiles {
  static constexpr const char* kModule = "itk_text";
};

struct Hdf5TransformFiles : TransformFiles {
  static constexpr const char* kModule = "itk_hdf5";
};

}  // namespace usct::io
