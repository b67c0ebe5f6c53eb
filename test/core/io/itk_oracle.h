#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace usct::test {

/// A volume as ITK sees it, in plain arrays: ITK brings an Eigen of its own, which cannot meet the
/// system's in one source file.
struct ItkImage {
  std::vector<int> size;
  std::vector<double> spacing, origin;
  /// Three numbers per index axis: its direction in LPS.
  std::vector<double> direction;
  std::vector<short> voxels;
};

/// Files of 16-bit voxels. Throw what ITK throws.
ItkImage read_by_itk(const std::filesystem::path& path);
void write_by_itk(const ItkImage& image, const std::filesystem::path& path, bool compressed);

}  // namespace usct::test
