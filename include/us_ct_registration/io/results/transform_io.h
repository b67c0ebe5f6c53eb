#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string>

/// ITK transform files, as 3D Slicer, elastix and ANTs read and write them: `.tfm` and `.txt`
/// (text), `.h5` and `.hdf5` (HDF5).
///
/// Fixed = ultrasound, moving = CT: the *file* maps points of the US frame to CT points (T_ct_us),
/// in millimetres, LPS. Callers always get and give its inverse, T_us_ct.
namespace usct {

/// Whether the extension is one of those above.
bool has_transform_extension(const std::filesystem::path& path);

/// Reads any linear ITK transform of three dimensions, or several composed, in single or double
/// precision, whose matrix is a rotation: Euler3D, VersorRigid3D, Similarity3D with scale 1,
/// Affine, ...
///
/// Throws InputError, naming the file: if it is not such a file or not of a known extension; if the
/// transform is not linear; or if the matrix is not a rotation (each entry of MᵀM within 1e-5 of
/// the identity), naming determinant and deviation of one that is scaled, sheared or mirrored.
Eigen::Isometry3d read_T_us_ct(const std::filesystem::path& path);

/// Writes the inverse of T_us_ct, atomically, as an AffineTransform in double precision: the ITK
/// transform that every program reads, and that needs no angles. Reading it gives the same
/// transform within 1e-12. Throws InputError if the extension is unknown, the folder cannot be
/// written to, or T_us_ct is not rigid.
void write_T_us_ct(const Eigen::Isometry3d& T_us_ct, const std::filesystem::path& path);

/// Entry in the table of formats: see FileFormat::describe.
std::string describe_transform(const std::filesystem::path& path);

}  // namespace usct
