#include "io/volumes/volume_header.h"

#include <Eigen/SVD>
#include <cmath>

#include "io/bytes.h"
#include "io/format.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::io {
namespace {

/// The largest compression ratio of deflate (zlib's technical notes).
constexpr double kDeflateLargestRatio = 1032.0;
/// The tolerance of Grid::validate: a larger deviation is shear, a smaller one is rounding of
/// decimal or 32-bit numbers.
constexpr double kPerpendicularTolerance = 1e-4;
/// Axes that deviate by less than this are kept exactly as they are written.
constexpr double kExactTolerance = 1e-12;

constexpr struct {
  const char* name;
  std::size_t bytes;
} kComponents[] = {{"int8", 1},   {"uint8", 1}, {"int16", 2},  {"uint16", 2},  {"int32", 4},
                   {"uint32", 4}, {"int64", 8}, {"uint64", 8}, {"float32", 4}, {"float64", 8}};

/// A size for messages: all its digits, unless it is too large for a whole number.
std::string count_text(double count) {
  return count < 1e15 ? std::to_string(static_cast<std::uintmax_t>(count)) : format(count);
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

}  // namespace

const char* name_of(Component component) { return kComponents[static_cast<int>(component)].name; }
std::size_t bytes_of(Component component) { return kComponents[static_cast<int>(component)].bytes; }

Grid grid_from_axes(const std::string& source, const std::string& field,
                    const Eigen::Vector3i& size, const Eigen::Matrix3d& axes_mm,
                    const Eigen::Vector3d& origin_mm) {
  Grid grid;
  grid.size = size;
  grid.origin_mm = origin_mm;
  grid.spacing_mm = axes_mm.colwise().norm();
  if (!axes_mm.allFinite() || (grid.spacing_mm.array() <= 0.0).any())
    throw InputError(source, "'" + field + "' gives a spacing of " + format(grid.spacing_mm) +
                                 " mm, must be finite and > 0");
  grid.direction = axes_mm * grid.spacing_mm.cwiseInverse().asDiagonal();
  const Eigen::Matrix3d cosines = grid.direction.transpose() * grid.direction;
  for (int a = 0; a < 3; ++a)
    for (int b = a + 1; b < 3; ++b)
      if (std::abs(cosines(a, b)) > kPerpendicularTolerance)
        throw InputError(source, "'" + field + "': axes " + std::to_string(a) + " and " +
                                     std::to_string(b) + " meet at " +
                                     format(std::acos(cosines(a, b)) / kDegree) +
                                     " degrees, must be 90 (sheared volumes are not read)");
  if ((cosines - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > kExactTolerance)
    grid.direction = nearest_rotation(grid.direction);
  grid.validate(source);
  return grid;
}

void check_data_size(const std::string& source, const std::string& field,
                     const VolumeHeader& header) {
  const double announced =
      header.grid.size.cast<double>().prod() * static_cast<double>(bytes_of(header.component));
  const bool raw = header.encoding == Encoding::kRaw;
  const std::uintmax_t file_bytes = std::filesystem::file_size(header.data_file);
  const std::uintmax_t before = header.begin + (raw ? header.skip : 0);
  const double stored = file_bytes > before ? static_cast<double>(file_bytes - before) : 0.0;
  if (raw ? announced == stored : announced <= kDeflateLargestRatio * stored) return;
  throw InputError(
      source,
      "'" + field + "' is " + format(header.grid.size) + ", so the voxels (" +
          name_of(header.component) + ") take " + count_text(announced) + " bytes, but '" +
          header.data_file.filename().string() + "' has " + count_text(stored) +
          (raw ? " for them, must be the same" : " compressed bytes, which cannot hold them"));
}

}  // namespace usct::io
