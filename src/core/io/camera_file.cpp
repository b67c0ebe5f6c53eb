#include "us_ct_registration/io/camera_file.h"

#include <algorithm>

#include "io/yaml_keys.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

/// The numbers of a matrix `{rows, cols, data}`.
std::vector<double> matrix_of(io::YamlKeys& keys, const std::string& key) {
  io::YamlKeys matrix(keys.node(key), keys.source(), keys.path_of(key));
  return matrix.table("data");
}

void require_count(const io::YamlKeys& keys, const std::string& key, std::size_t count,
                   std::size_t wanted) {
  if (count != wanted)
    throw InputError(keys.source(), "'" + keys.path_of(key) + "' has " + std::to_string(count) +
                                        " numbers, must have " + std::to_string(wanted));
}

}  // namespace

Camera read_camera(const std::filesystem::path& path) {
  io::YamlKeys keys(io::read_yaml(path), path.string());
  CameraIntrinsics intrinsics;
  intrinsics.width = keys.whole_number("image_width");
  intrinsics.height = keys.whole_number("image_height");
  const std::vector<double> K = matrix_of(keys, "camera_matrix");
  require_count(keys, "camera_matrix", K.size(), 9);
  if (K[1] != 0.0 || K[3] != 0.0 || K[6] != 0.0 || K[7] != 0.0 || K[8] != 1.0)
    throw InputError(path.string(),
                     "'camera_matrix' must be fx 0 cx, 0 fy cy, 0 0 1: there is no skew");
  intrinsics.fx = K[0];
  intrinsics.cx = K[2];
  intrinsics.fy = K[4];
  intrinsics.cy = K[5];
  const std::string model = keys.text("distortion_model");
  if (model != "plumb_bob" && model != "rational_polynomial")
    throw InputError(path.string(), "'distortion_model' is '" + model +
                                        "', must be plumb_bob or rational_polynomial");
  const std::vector<double> D = matrix_of(keys, "distortion_coefficients");
  require_count(keys, "distortion_coefficients", D.size(), model == "plumb_bob" ? 5 : 8);
  std::copy(D.begin(), D.end(), intrinsics.distortion.begin());
  return Camera(intrinsics, path.string());
}

}  // namespace usct
