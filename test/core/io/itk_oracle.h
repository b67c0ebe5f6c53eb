#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace usct::test {

/// A volume as ITK reads it, in plain arrays: ITK's headers include its own copy of Eigen, which
/// cannot be included in one source file with the system's Eigen.
struct ItkImage {
  std::vector<int> size;
  std::vector<double> spacing, origin;
  /// The three components of the direction, in LPS, of each index axis.
  std::vector<double> direction;
  std::vector<short> voxels;
};

/// Read and write files of 16-bit voxels. Throw ITK's exceptions.
ItkImage read_by_itk(const std::filesystem::path& path);
void write_by_itk(const ItkImage& image, const std::filesystem::path& path, bool compressed);

}  // namespace usct::test
