#pragma once

#include <array>
#include <filesystem>
#include <string>

/// ITK transform files as plain numbers. ITK's headers include its own copy of Eigen, which cannot
/// be included in one translation unit with the system's Eigen.
namespace usct::io {

/// The map p -> matrix * p + translation.
struct LinearMap {
  std::array<std::array<double, 3>, 3> matrix;  // rows
  std::array<double, 3> translation;
  std::string type;  // ITK's name of the transform
};

/// Reads a file with one linear transform. Throws InputError for anything else.
LinearMap read_itk_transform(const std::filesystem::path& path);

/// Writes an AffineTransform in double precision, atomically.
void write_itk_transform(const LinearMap& map, const std::filesystem::path& path);

}  // namespace usct::io
