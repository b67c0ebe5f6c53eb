#include "endoscope_files.h"

#include <nlohmann/json.hpp>

#include "us_ct_registration/formatted.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/rendering/picture.h"

namespace usct::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using phantom::Endoscope;
using phantom::EndoscopeImage;
using phantom::Eye;

Json json_of(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

Json json_of(const Eigen::Isometry3d& T) {
  Json numbers = Json::array();
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) numbers.push_back(T.matrix()(row, column));
  return numbers;
}

/// The keys that camera_calibration_parsers reads; the projection is that of the left camera, or of
/// one alone.
std::string camera_yaml(const CameraIntrinsics& camera) {
  const auto& d = camera.distortion;
  return formatted(
      "image_width: %d\nimage_height: %d\ncamera_name: endoscope\n"
      "camera_matrix: {rows: 3, cols: 3, data: [%.10g, 0, %.10g, 0, %.10g, %.10g, 0, 0, 1]}\n"
      "distortion_model: plumb_bob\n"
      "distortion_coefficients: {rows: 1, cols: 5, data: [%.10g, %.10g, %.10g, %.10g, %.10g]}\n"
      "rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
      "projection_matrix: {rows: 3, cols: 4, data: [%.10g, 0, %.10g, 0, 0, %.10g, %.10g, 0, 0, 0, "
      "1, 0]}\n",
      camera.width, camera.height, camera.fx, camera.cx, camera.fy, camera.cy, d[0], d[1], d[2],
      d[3], d[4], camera.fx, camera.cx, camera.fy, camera.cy);
}

Json description_of(const Endoscope& endoscope) {
  const phantom::EndoscopeOptions& o = endoscope.options();
  Json frames = Json::array();
  for (int frame = 0; frame < o.frames; ++frame)
    frames.push_back({{"time_s", endoscope.time_s(frame)},
                      {"T_ct_left", json_of(endoscope.T_ct_camera(Eye::kLeft, frame))},
                      {"shift_ct_mm", json_of(endoscope.shift_ct_mm(frame))}});
  return {{"version", USCT_VERSION},
          {"options",
           {{"width", o.width},
            {"height", o.height},
            {"field_of_view_deg", o.field_of_view_deg},
            {"distortion", o.distortion},
            {"baseline_mm", o.baseline_mm},
            {"frames", o.frames},
            {"rate_hz", o.rate_hz},
            {"camera_motion_mm", o.camera_motion_mm},
            {"breathing_mm", o.breathing_mm},
            {"breathing_period_s", o.breathing_period_s},
            {"instruments", o.instruments},
            {"noise", o.noise}}},
          {"meaning",
           "T_ct_left: optical frame of the left camera (z forward, x right, y down) to "
           "coordinates of the CT, row by row, mm; the right camera is baseline_mm along its x "
           "axis; a point p_ct of the anatomy is at p_ct + shift_ct_mm"},
          {"baseline_mm", o.baseline_mm},
          {"tumour_centre_ct_mm", json_of(endoscope.tumour_centre_ct_mm())},
          {"frames", frames}};
}

Picture picture_of(const EndoscopeImage& image) {
  Picture picture(image.width, image.height);
  picture.pixels = image.rgb;
  return picture;
}

Picture picture_of_mask(const EndoscopeImage& image) {
  Picture picture(image.width, image.height);
  for (std::size_t i = 0; i < image.tumour.size(); ++i)
    std::fill_n(&picture.pixels[3 * i], 3, image.tumour[i]);
  return picture;
}

}  // namespace

void write_endoscope(const Endoscope& endoscope, const fs::path& folder, const Progress& progress) {
  fs::create_directory(folder);
  const int frames = endoscope.options().frames;
  for (int frame = 0; frame < frames; ++frame) {
    for (const Eye eye : {Eye::kLeft, Eye::kRight}) {
      const char* const side = eye == Eye::kLeft ? "left" : "right";
      const EndoscopeImage image = endoscope.image(eye, frame);
      write_png(picture_of(image), folder / formatted("%s_%04d.png", side, frame));
      write_png(picture_of_mask(image), folder / formatted("%s_tumour_%04d.png", side, frame));
    }
    if (progress) progress((frame + 1.0) / frames);
  }
  write_text(folder / "camera.yaml", camera_yaml(endoscope.intrinsics()));
  write_text(folder / "endoscope.json", description_of(endoscope).dump(1) + "\n");
}

}  // namespace usct::tools
