#include "us_ct_registration/io/results/transform_io.h"

#include "io/results/itk_transform.h"
#include "module.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

const io::TransformFiles& files_of(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".tfm" || extension == ".txt") return module<io::TextTransformFiles>();
  if (extension == ".h5" || extension == ".hdf5") return module<io::Hdf5TransformFiles>();
  throw InputError(path.string(), "extension is '" + extension +
                                      "', must be .tfm, .txt, .h5 or .hdf5 (ITK transform)");
}

}  // namespace

bool has_transform_extension(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  return extension == ".tfm" || extension == ".txt" || extension == ".h5" || extension == ".hdf5";
}

Eigen::Isometry3d read_T_us_ct(const std::filesystem::path& path) {
  const io::LinearMap map = files_of(path).read(path);
  Eigen::Isometry3d T_ct_us = Eigen::Isometry3d::Identity();
  for (int row = 0; row < 3; ++row) {
    const auto i = static_cast<std::size_t>(row);
    T_ct_us.linear().row(row) = Eigen::Map<const Eigen::RowVector3d>(map.matrix[i].data());
    T_ct_us.translation()[row] = map.translation[i];
  }
  require_rotation(T_ct_us.linear(), path.string(), map.type);
  if (!T_ct_us.translation().allFinite())
    throw InputError(path.string(), "translation is not finite");
  return T_ct_us.inverse();
}

void write_T_us_ct(const Eigen::Isometry3d& T_us_ct, const std::filesystem::path& path) {
  require_rotation(T_us_ct.linear(), path.string(), "T_us_ct");
  if (!T_us_ct.translation().allFinite())
    throw InputError(path.string(), "'T_us_ct' is not finite");
  const Eigen::Isometry3d T_ct_us = T_us_ct.inverse();
  io::LinearMap map;
  for (int row = 0; row < 3; ++row) {
    const auto i = static_cast<std::size_t>(row);
    for (int column = 0; column < 3; ++column)
      map.matrix[i][static_cast<std::size_t>(column)] = T_ct_us.linear()(row, column);
    map.translation[i] = T_ct_us.translation()[row];
  }
  files_of(path).write(map, path);
}

}  // namespace usct
