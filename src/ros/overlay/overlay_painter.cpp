#include "ros/overlay/overlay_painter.h"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "ros/conversions/poses.h"
#include "ros/overlay/overlay_placement.h"
#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/rendering/result_marks.h"

namespace usct::ros_interface {
namespace {

namespace encodings = sensor_msgs::image_encodings;
using us_ct_registration::OverlayStatus;

const Picture::Colour kRed(255, 80, 80);
const Picture::Colour kAmber(255, 190, 60);
const Picture::Colour kWhite(255, 255, 255);

/// A copy of the image in which can be drawn: rgb8 or bgr8. Throws InputError if it cannot be
/// decoded.
sensor_msgs::ImagePtr drawable(const sensor_msgs::Image& image) try {
  if (image.encoding != encodings::RGB8 && image.encoding != encodings::BGR8)
    return cv_bridge::toCvCopy(image, encodings::RGB8)->toImageMsg();
  const std::uint64_t row_bytes = 3 * std::uint64_t{image.width};
  if (image.width == 0 || image.height == 0 || image.step < row_bytes ||
      image.data.size() < static_cast<std::size_t>(image.step) * image.height)
    throw InputError("image", "has " + std::to_string(image.data.size()) + " bytes and rows of " +
                                  std::to_string(image.step) + ", must have " +
                                  std::to_string(image.height) + " rows of at least " +
                                  std::to_string(row_bytes));
  return boost::make_shared<sensor_msgs::Image>(image);
} catch (const InputError&) {
  throw;
} catch (const std::exception& error) {
  throw InputError("image", error.what());
}

ImageView view_of(sensor_msgs::Image& image) {
  return {image.data.data(), static_cast<int>(image.width), static_cast<int>(image.height),
          static_cast<std::ptrdiff_t>(image.step), image.encoding == encodings::BGR8};
}

std::string bound_text(const OverlayScene& scene, double bound_m) {
  const std::string age = formatted("aligned %ld min ago", std::lround(scene.age_s / 60.0));
  if (!std::isfinite(bound_m)) return age;
  return age + formatted("; error < %.1f mm in 9 of 10 cases", kMmPerM * bound_m);
}

/// Writes a text from this line on, and returns the line after it. Long texts are cut, so that they
/// do not hide the video; the status has all of it.
int write_text(const ImageView& image, const std::string& text, int line,
               const Picture::Colour& colour) {
  constexpr std::size_t kMostLines = 4;
  std::vector<std::string> parts = wrapped(text, letters_per_line(image));
  if (parts.size() > kMostLines) {
    parts.resize(kMostLines);
    parts.back() += " ...";
  }
  for (const std::string& part : parts) draw_line(image, part, line++, colour);
  return line;
}

void write_legend(const ImageView& image, const std::vector<OverlayStructure>& structures) {
  int line = -1;
  for (auto it = structures.rbegin(); it != structures.rend(); ++it)
    draw_line(image, it->name, line--, it->colour);
}

}  // namespace

OverlayPainter::OverlayPainter(OverlayPainterOptions options, const OverlaySceneKeeper& keeper,
                               const TfBuffer& tf)
    : options_(options), keeper_(keeper), tf_(tf), renderer_(options.drawing) {}

void OverlayPainter::widen_bounds(const Eigen::Isometry3d& T_camera_ct,
                                  std::vector<OverlayStructure>& structures) const {
  for (OverlayStructure& structure : structures) {
    if (!structure.bound_mm || structure.surface->points_mm.empty()) continue;
    double farthest_mm = 0.0;
    constexpr std::size_t kMostPoints = 200;
    const std::vector<Eigen::Vector3d>& points_mm = structure.surface->points_mm;
    for (std::size_t i = 0; i < points_mm.size(); i += 1 + points_mm.size() / kMostPoints)
      farthest_mm = std::max(farthest_mm, (T_camera_ct * points_mm[i]).norm());
    // The errors are independent of each other.
    structure.bound_mm = std::hypot(*structure.bound_mm, options_.hand_eye_error_mm,
                                    options_.hand_eye_error_rad * farthest_mm);
    structure.bound_px = options_.camera_error_px;
  }
}

void OverlayPainter::draw(const OverlayJob& job, const OverlayScene& scene, const ImageView& image,
                          OverlayStatus& status) {
  if (!job.info) throw std::runtime_error(job.problem);
  if (!scene.refusal.empty()) throw std::runtime_error(scene.refusal);
  const CameraModel model = camera_model(*job.info, job.use, "camera_info");
  const CameraIntrinsics& size = model.camera.intrinsics();
  if (size.width != image.width || size.height != image.height)
    throw InputError("camera_info", "is for images of " + std::to_string(size.width) + " x " +
                                        std::to_string(size.height) + ", the image has " +
                                        std::to_string(image.width) + " x " +
                                        std::to_string(image.height));
  const Eigen::Isometry3d T_camera_ct =
      model.T_camera_frame * T_frame_ct_at(tf_, scene, job.info->header.frame_id,
                                           job.image->header.stamp, ::ros::Time::now(),
                                           options_.tf_timeout_s);
  std::vector<OverlayStructure> structures = scene.structures;
  widen_bounds(T_camera_ct, structures);
  const OverlayCoverage coverage = renderer_.draw(image, model.camera, T_camera_ct, structures);
  for (std::size_t i = 0; i < structures.size(); ++i) {
    if (coverage[i] > 0) status.in_view.push_back(structures[i].name);
    if (structures[i].bound_mm)
      status.error_bound = std::fmax(status.error_bound, *structures[i].bound_mm / kMmPerM);
  }
  status.result_id = scene.result_id;
  status.state = OverlayStatus::DRAWN;
}

Overlay OverlayPainter::paint(const OverlayJob& job) {
  Overlay overlay;
  OverlayStatus& status = overlay.status;
  status.header = job.image->header;
  status.error_bound = std::numeric_limits<double>::quiet_NaN();
  const OverlayScene scene = keeper_.at(job.image->header.stamp);
  std::string refusal;
  try {
    overlay.image = drawable(*job.image);
    draw(job, scene, view_of(*overlay.image), status);
    if (!keeper_.is_current(scene)) refusal = "the alignment changed while the image was drawn";
  } catch (const std::exception& error) {
    refusal = error.what();
  }
  if (!refusal.empty()) {
    // What was drawn before it was refused is forgotten.
    status.state = OverlayStatus::NOTHING;
    status.in_view.clear();
    status.error_bound = std::numeric_limits<double>::quiet_NaN();
    status.result_id = 0;
    status.message = refusal;
    if (!overlay.image) return overlay;
    overlay.image = drawable(*job.image);
  }
  const ImageView image = view_of(*overlay.image);
  const bool is_drawn = refusal.empty();
  const std::string first =
      is_drawn ? bound_text(scene, status.error_bound) : "NO OVERLAY: " + refusal;
  int line = write_text(image, first, 0, is_drawn ? kWhite : kRed);
  if (is_drawn) write_legend(image, scene.structures);
  std::vector<std::string> warnings = scene.warnings;
  if (!job.warning.empty()) warnings.push_back(job.warning);
  for (const std::string& warning : warnings) {
    line = write_text(image, warning, line, kAmber);
    status.message += (status.message.empty() ? "" : "; ") + warning;
  }
  if (is_drawn && !warnings.empty()) status.state = OverlayStatus::DRAWN_WITH_WARNING;
  return overlay;
}

}  // namespace usct::ros_interface
