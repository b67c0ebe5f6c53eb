#include "tools/ros/read_endoscope.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/camera_file.h"

namespace usct::tools {
namespace {

Eigen::Isometry3d pose_of(const nlohmann::json& numbers) {
  const auto values = numbers.get<std::array<double, 16>>();
  Eigen::Isometry3d T;
  T.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
  return T;
}

}  // namespace

ros_interface::EndoscopeVideo read_endoscope(const std::filesystem::path& folder) {
  const std::filesystem::path description = folder / "endoscope.json";
  std::ifstream in(description);
  if (!in) throw InputError(description.string(), "cannot be read");
  ros_interface::EndoscopeVideo video;
  video.folder = folder;
  video.camera = read_camera(folder / "camera.yaml").intrinsics();
  try {
    const nlohmann::json json = nlohmann::json::parse(in);
    video.baseline_mm = json.at("baseline_mm");
    for (const nlohmann::json& frame : json.at("frames"))
      video.frames.push_back({frame.at("time_s"), pose_of(frame.at("T_ct_left"))});
  } catch (const nlohmann::json::exception& error) {
    throw InputError(description.string(), error.what());
  }
  return video;
}

}  // namespace usct::tools
