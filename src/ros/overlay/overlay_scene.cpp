#include "ros/overlay/overlay_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <unordered_map>

#include "ros/conversions/alignment.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/surface_markers.h"
#include "ros/conversions/times.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/target_errors.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using visualization_msgs::Marker;

/// A point bit by bit, so that corners that triangles share are found again.
struct PointKey {
  std::array<double, 3> values;
  bool operator==(const PointKey& other) const { return values == other.values; }
};

struct PointHash {
  std::size_t operator()(const PointKey& key) const {
    std::size_t hash = 0;
    for (const double value : key.values) hash = 31 * hash + std::hash<double>()(value);
    return hash;
  }
};

/// The triangles of a marker, in which each point is repeated by each triangle that has it.
Surface surface_from(const Marker& marker, const std::string& source) {
  if (marker.points.size() % 3 != 0)
    throw InputError(source, "'" + marker.ns + "' has " + std::to_string(marker.points.size()) +
                                 " points, must have three per triangle");
  const Eigen::Isometry3d T_frame_marker = from_message_mm(marker.pose, source);
  Surface surface;
  surface.triangles.resize(marker.points.size() / 3);
  std::unordered_map<PointKey, std::uint32_t, PointHash> known;
  for (std::size_t i = 0; i < marker.points.size(); ++i) {
    const geometry_msgs::Point& p = marker.points[i];
    const auto [entry, is_new] = known.try_emplace(
        PointKey{{p.x, p.y, p.z}}, static_cast<std::uint32_t>(surface.points_mm.size()));
    if (is_new) surface.points_mm.push_back(T_frame_marker * point_from_message_mm(p));
    if (!surface.points_mm[entry->second].allFinite())
      throw InputError(source, "'" + marker.ns + "' has a point that is not finite");
    surface.triangles[i / 3][i % 3] = entry->second;
  }
  return surface;
}

/// The namespace of a marker of `ct/surface` is "NUMBER NAME".
std::string name_of(const Marker& marker) {
  const std::size_t blank = marker.ns.find(' ');
  return blank == std::string::npos ? marker.ns : marker.ns.substr(blank + 1);
}

Picture::Colour colour_of(const Marker& marker) {
  const auto channel = [](float value) {
    return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(value, 0.0F, 1.0F)));
  };
  return {channel(marker.color.r), channel(marker.color.g), channel(marker.color.b)};
}

std::string minutes_text(double seconds) {
  return std::to_string(static_cast<long>(std::lround(seconds / 60.0))) + " min";
}

}  // namespace

OverlaySceneKeeper::Surfaces OverlaySceneKeeper::surfaces_from(
    const visualization_msgs::MarkerArray& message) {
  Surfaces surfaces;
  surfaces.ct_crc32 = ct_crc32_of(message);
  for (const Marker& marker : message.markers) {
    if (marker.action != Marker::ADD || marker.type != Marker::TRIANGLE_LIST) continue;
    surfaces.structures.push_back(
        {std::make_shared<const Surface>(surface_from(marker, "ct/surface")), name_of(marker),
         colour_of(marker), marker.header.frame_id});
  }
  return surfaces;
}

void OverlaySceneKeeper::take_surface(const visualization_msgs::MarkerArray& message) try {
  Surfaces surfaces = surfaces_from(message);
  const std::lock_guard lock(mutex_);
  surfaces_ = std::move(surfaces);
} catch (const InputError&) {
  const std::lock_guard lock(mutex_);
  surfaces_.reset();  // those before may be of another CT
  throw;
}

void OverlaySceneKeeper::take_info(const msg::CtInfo& message) {
  const std::lock_guard lock(mutex_);
  ct_crc32_ = message.crc32;
}

void OverlaySceneKeeper::take_alignment(const msg::Alignment& message) {
  const std::lock_guard lock(mutex_);
  alignment_ = message;
}

void OverlaySceneKeeper::take_pose(const geometry_msgs::PoseWithCovarianceStamped& message) {
  const std::lock_guard lock(mutex_);
  pose_ = message;
}

void OverlaySceneKeeper::take_result(const msg::RegistrationResult& message) {
  // A person cancelled it and knows it; the alignment is as good as before.
  if (message.status.code == msg::StatusCode::CANCELLED) return;
  const std::lock_guard lock(mutex_);
  last_refusal_ = message.status.code == msg::StatusCode::REGISTERED ? "" : message.status.message;
}

std::string OverlaySceneKeeper::why_not() const {
  if (!alignment_) return "tf_publisher has not said which alignment counts";
  if (alignment_->state == msg::Alignment::NONE) return "no alignment: " + alignment_->message;
  if (!surfaces_) return "no surfaces of the CT";
  // Surfaces come later than the summary of their CT, and not all who send them say of which CT
  // they are.
  const std::uint32_t aligned = alignment_->ct_crc32;
  if (ct_crc32_ != aligned || surfaces_->ct_crc32.value_or(aligned) != aligned)
    return "the surfaces are of another CT than the one that was aligned";
  bool is_empty = true;
  for (const Structure& one : surfaces_->structures) {
    is_empty = is_empty && one.surface->triangles.empty();
    if (one.frame != alignment_->ct_frame)
      return "the surface '" + one.name + "' is in the frame '" + one.frame +
             "', must be in that of the CT, '" + alignment_->ct_frame + "'";
  }
  return is_empty ? "the surfaces of the CT are empty" : "";
}

std::vector<std::string> OverlaySceneKeeper::warnings_at(double age_s) const {
  std::vector<std::string> warnings;
  if (alignment_->state == msg::Alignment::RESTORED)
    warnings.push_back("RESTORED from before a restart: the patient may have moved");
  if (age_s > options_.old_after_s)
    warnings.push_back("OLD: the ultrasound was acquired " + minutes_text(age_s) + " ago");
  if (alignment_->waiting_id != 0)
    warnings.push_back("WAITING: a newer registration waits for accept or reject");
  if (!last_refusal_.empty())
    warnings.push_back("REFUSED: the last registration: " + last_refusal_);
  return warnings;
}

std::optional<double> OverlaySceneKeeper::bound_mm(const Surface& surface,
                                                   const Eigen::Isometry3d& T_fixed_ct) const {
  const bool is_of_alignment = pose_ && pose_->header.stamp == alignment_->header.stamp &&
                               pose_->header.frame_id == alignment_->header.frame_id;
  if (!is_of_alignment) {
    const double expected_mm = kMmPerM * alignment_->expected_error;
    if (!std::isfinite(expected_mm)) return std::nullopt;
    return options_.bound_factor * expected_mm;
  }
  // The motion is about the origin of the CT, in the axes of the fixed frame.
  constexpr std::size_t kMostPoints = 200;
  const std::size_t step = 1 + surface.points_mm.size() / kMostPoints;
  std::vector<Eigen::Vector3d> points_mm;
  for (std::size_t i = 0; i < surface.points_mm.size(); i += step)
    points_mm.push_back(T_fixed_ct.linear() * surface.points_mm[i]);
  try {
    const double worst_mm =
        expected_tre_mm(covariance_from_message_mm(pose_->pose.covariance), points_mm).max_mm;
    if (worst_mm > 0.0) return options_.bound_factor * worst_mm;
  } catch (const InputError&) {  // another program's covariance, or no point
  }
  return std::nullopt;
}

OverlayScene OverlaySceneKeeper::at(const ::ros::Time& stamp) const {
  const std::lock_guard lock(mutex_);
  OverlayScene scene;
  scene.refusal = why_not();
  if (!scene.refusal.empty()) {
    if (!last_refusal_.empty())
      scene.warnings.push_back("REFUSED: the last registration: " + last_refusal_);
    return scene;
  }
  try {
    scene.T_fixed_ct = T_fixed_ct_from(*alignment_).value();
  } catch (const InputError& error) {
    scene.refusal = error.what();
    return scene;
  }
  scene.fixed_frame = alignment_->header.frame_id;
  scene.ct_frame = alignment_->ct_frame;
  scene.result_id = alignment_->result_id;
  scene.ct_crc32 = alignment_->ct_crc32;
  scene.age_s = seconds_between(alignment_->header.stamp, stamp);
  scene.warnings = warnings_at(scene.age_s);
  for (const Structure& structure : surfaces_->structures) {
    const auto found = options_.styles.find(structure.name);
    const StructureStyle style = found == options_.styles.end() ? StructureStyle() : found->second;
    if (!style.is_visible) continue;
    OverlayStructure drawn;
    drawn.surface = structure.surface;
    drawn.name = structure.name;
    drawn.colour = style.colour.value_or(structure.colour);
    drawn.opacity = style.opacity;
    if (style.has_band) {
      drawn.bound_mm = bound_mm(*structure.surface, scene.T_fixed_ct);
      if (drawn.bound_mm)
        scene.bound_mm = std::max(scene.bound_mm.value_or(0.0), *drawn.bound_mm);
      else
        scene.warnings.push_back("UNKNOWN ERROR of " + structure.name + ": there is no band");
    }
    scene.structures.push_back(std::move(drawn));
  }
  if (const std::string missing = missing_band(); !missing.empty())
    scene.warnings.push_back("NO BAND: ct/surface has no '" + missing + "'");
  return scene;
}

std::string OverlaySceneKeeper::missing_band() const {
  std::string wished;
  for (const auto& [name, style] : options_.styles) {
    if (!style.has_band) continue;
    const auto is_it = [&wanted = name](const Structure& one) { return one.name == wanted; };
    if (std::any_of(surfaces_->structures.begin(), surfaces_->structures.end(), is_it)) return {};
    wished = name;
  }
  return wished;
}

bool OverlaySceneKeeper::is_current(const OverlayScene& scene) const {
  const std::lock_guard lock(mutex_);
  if (!why_not().empty()) return false;
  return alignment_->result_id == scene.result_id &&
         alignment_->header.frame_id == scene.fixed_frame &&
         alignment_->ct_frame == scene.ct_frame &&
         T_fixed_ct_from(*alignment_).value().isApprox(scene.T_fixed_ct, 1e-9);
}

std::string OverlaySceneKeeper::misnamed() const {
  const std::lock_guard lock(mutex_);
  if (!surfaces_) return {};
  const std::vector<Structure>& structures = surfaces_->structures;
  std::string known;
  for (const Structure& structure : structures)
    known += (known.empty() ? "'" : ", '") + structure.name + "'";
  for (const auto& [name, style] : options_.styles)
    if (std::none_of(structures.begin(), structures.end(),
                     [&wanted = name](const Structure& one) { return one.name == wanted; }))
      return "the parameters name '" + name +
             "', which ct/surface does not have; it has: " + (known.empty() ? "nothing" : known);
  return {};
}

}  // namespace usct::ros_interface
