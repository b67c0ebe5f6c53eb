#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "us_ct_registration/volume/volume.h"

/// Image volumes in NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd) and NIfTI-1 (.nii, .nii.gz).
///
/// The format is chosen by the extension, and the content must agree with it. Positions are LPS
/// millimetres in any case. Readers are strict: a volume without a stated orientation, with sheared
/// or infinite axes, with other than three dimensions or one value per voxel, or whose size does
/// not match the size of its file, is refused; nothing is repaired and no default replaces a
/// missing field. Sizes are checked against the file before memory is allocated, and checksums of
/// compressed data are verified. Ultrasound sequences in these formats (igsio.h, prescan_nrrd.h)
/// are refused.
namespace usct {

/// A summary of the header of a volume.
struct VolumeInfo {
  /// "NRRD", "MetaImage" or "NIfTI".
  std::string format;
  Grid grid;
  /// Type of the stored values: "uint8", "int16", "float32" and so on.
  std::string component;
  /// Size of a stored value.
  std::size_t voxel_bytes = 0;
  bool compressed = false;
  /// Values are stored times `scale` plus `offset` (NIfTI's scl_slope and scl_inter).
  double scale = 1.0;
  double offset = 0.0;
  /// Warnings about unusual but valid content of the header.
  std::vector<std::string> warnings;
};

/// Whether the extension is one of a volume format above.
bool has_volume_extension(const std::filesystem::path& path);

/// Reads the header alone. Throws InputError, naming file, field, value and constraint.
VolumeInfo read_volume_info(const std::filesystem::path& path);

/// Reads a volume as T (uint8_t, int16_t, uint16_t or float).
///
/// Stored values that T cannot hold are an InputError that names the range found; so are NaN, and
/// fractions if T is uint8_t or uint16_t. If T is int16_t, fractions are rounded to nearest,
/// because CT is often stored as rescaled floating-point Hounsfield units.
/// Throws InputError, naming file, field, value and constraint.
template <typename T>
Volume<T> read_volume(const std::filesystem::path& path);

/// Writes a volume, atomically (see atomic_file.h); compressed only as .nii.gz. NIfTI holds
/// positions as 32-bit floats, the other formats as doubles. MetaImage as .mhd puts the voxels
/// beside the header, in a file of the same name that ends in .raw.
/// Throws InputError for an unknown extension, an invalid grid, a folder that cannot be written to,
/// or, for NIfTI, more than 32767 voxels along an axis.
template <typename T>
void write_volume(const Volume<T>& volume, const std::filesystem::path& path);

/// Entry in the table of formats: see FileFormat::describe.
std::string describe_volume(const std::filesystem::path& path);

}  // namespace usct
