#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/bytes.h"
#include "us_ct_registration/geometry/grid.h"

namespace usct::io {

/// Headers in text are read up to this size, bytes.
constexpr std::size_t kLongestHeader = std::size_t{1} << 20;

enum class Component {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64
};

/// "int8" and so on.
const char* name_of(Component component);
std::size_t bytes_of(Component component);

enum class Encoding { kRaw, kZlib, kGzip };

/// The content of a volume's header, in terms that all formats share, and the place of its voxels.
struct VolumeHeader {
  std::string format;
  Grid grid;
  Component component = Component::kUint8;
  bool big_endian = false;
  /// The value of a voxel is stored * scale + offset.
  double scale = 1.0;
  double offset = 0.0;
  std::vector<std::string> warnings;

  std::filesystem::path data_file;
  Encoding encoding = Encoding::kRaw;
  /// First byte in data_file of the voxels, or of the compressed stream that holds them.
  std::uintmax_t begin = 0;
  /// Bytes of the decompressed stream before the first voxel.
  std::uintmax_t skip = 0;

  /// Size of the voxels as stored, uncompressed.
  std::uintmax_t voxel_bytes() const {
    return static_cast<std::uintmax_t>(grid.voxel_count()) * bytes_of(component);
  }
};

/// Each of these reads the header of one format and checks everything that can be checked without
/// reading voxels, including that the data file is large enough. Throw InputError.
VolumeHeader read_nrrd_header(const std::filesystem::path& path);
VolumeHeader read_meta_header(const std::filesystem::path& path);
VolumeHeader read_nifti_header(const std::filesystem::path& path);

/// Each of these makes the header of one format, for voxels that are little-endian and not
/// compressed.
Bytes nrrd_header(const Grid& grid, Component component);
/// `data_file` is LOCAL if the voxels follow the header. Throws InputError, naming `source`, for a
/// name that readers would not take for that of this one file.
Bytes meta_header(const std::string& source, const Grid& grid, Component component,
                  const std::string& data_file);
/// Throws InputError, naming `source`, for more voxels along an axis than NIfTI can state, or for
/// lengths beyond its 32-bit numbers.
Bytes nifti_header(const std::string& source, const Grid& grid, Component component);

/// A grid whose index axes step by the columns of `axes_mm`. Throws InputError, naming `source` and
/// `field`, if a size is < 1, or an axis is not finite, of no length, or not perpendicular to the
/// others.
Grid grid_from_axes(const std::string& source, const std::string& field,
                    const Eigen::Vector3i& size, const Eigen::Matrix3d& axes_mm,
                    const Eigen::Vector3d& origin_mm);

/// Throws InputError unless the data file can hold the voxels that the header announces: raw voxels
/// must fill it exactly, compressed ones must lie within the largest ratio of deflate. `field`
/// names the field that states the size.
void check_data_size(const std::string& source, const std::string& field,
                     const VolumeHeader& header);

}  // namespace usct::io
