#include "io/description.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"

namespace usct {

using io::Json;

namespace {

/// The request to the ROS service set_initial_alignment for this pose of ultrasound whose frame in
/// tf is `us`: YAML, m.
std::string request_of(const Eigen::Isometry3d& T_us_ct) {
  constexpr double kMPerMm = 1e-3;
  const Eigen::Vector3d t_m = kMPerMm * T_us_ct.translation();
  const Eigen::Quaterniond q(T_us_ct.linear());
  return formatted(
      "{type: 1, header: {frame_id: us}, transform: {translation: {x: %.9g, y: %.9g, z: %.9g}, "
      "rotation: {x: %.12g, y: %.12g, z: %.12g, w: %.12g}}}",
      t_m.x(), t_m.y(), t_m.z(), q.x(), q.y(), q.z(), q.w());
}

}  // namespace

std::string describe_transform(const std::filesystem::path& path) {
  const Eigen::Isometry3d T_us_ct = read_T_us_ct(path);
  Json json;
  json["T_us_ct"] = Json::array();
  for (int row = 0; row < 4; ++row) {
    Json line = Json::array();
    for (int column = 0; column < 4; ++column) line.push_back(T_us_ct.matrix()(row, column));
    json["T_us_ct"].push_back(line);
  }
  json["rotation_deg"] = Eigen::AngleAxisd(T_us_ct.linear()).angle() / kDegree;
  json["translation_mm"] = T_us_ct.translation().norm();
  json["set_initial_alignment"] = request_of(T_us_ct);
  return io::as_text(json);
}

std::string describe_result(const std::filesystem::path& path) {
  const RegistrationResult result = read_result(path);
  Json json;
  json["status"] = status_name(result.status);
  json["message"] = result.message;
  json["similarity"] = result.similarity;
  json["overlap"] = result.overlap;
  json["candidates"] = result.candidates.size();
  json["version"] = result.version;
  return io::as_text(json);
}

std::string describe_points(const std::filesystem::path& path) {
  const std::vector<Eigen::Vector3d> points_mm = read_points_mm(path);
  Eigen::Vector3d low = points_mm.front();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& p_mm : points_mm) {
    low = low.cwiseMin(p_mm);
    high = high.cwiseMax(p_mm);
  }
  Json json;
  json["points"] = points_mm.size();
  json["from_mm"] = io::list(low);
  json["to_mm"] = io::list(high);
  return io::as_text(json);
}

}  // namespace usct
