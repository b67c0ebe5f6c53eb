#pragma once

#include <array>
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

struct ItkTransform {
  std::string type;
  std::vector<double> parameters, fixed_parameters;
};

/// Writes one transform, or several as a composite, as registration programs do.
void write_by_itk(const std::vector<ItkTransform>& parts, const std::filesystem::path& path);

/// Where ITK's reader maps a point.
std::array<double, 3> moved_by_itk(const std::filesystem::path& path,
                                   const std::array<double, 3>& point);

/// Writes a HDF5 file of one transform, right or wrong.
void write_hdf5_transform(const ItkTransform& transform, bool with_fixed_parameters,
                          const std::filesystem::path& path);

}  // namespace usct::test
