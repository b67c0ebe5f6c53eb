#include "ros/conversions/surface_markers.h"

#include <charconv>

#include "ros/conversions/poses.h"
#include "us_ct_registration/rendering/result_marks.h"

namespace usct::ros_interface {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

const std::string kOfCt = "surfaces of the CT with the crc32 ";

constexpr double kTitleM = 0.010;  // height of letters
constexpr double kReasonM = 0.005;

/// It needs the frame of the markers that it deletes: rviz takes one without a frame on another
/// way, on which it overtakes markers that were sent just before it, and these then stay.
Marker deletes_all(const std::string& frame) {
  Marker marker;
  marker.header.frame_id = frame;
  marker.pose.orientation.w = 1.0;
  marker.action = Marker::DELETEALL;
  return marker;
}

Marker to_marker(int label, const Surface& surface, const LabelTable& labels,
                 const std::string& frame) {
  Marker marker;
  marker.header.frame_id = frame;
  marker.ns = label_text(label, labels);
  marker.id = label;
  marker.type = Marker::TRIANGLE_LIST;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  const auto [red, green, blue] = label_colour(label, labels);
  marker.color.r = red;
  marker.color.g = green;
  marker.color.b = blue;
  marker.color.a = 1.0F;
  marker.frame_locked = true;
  marker.points.reserve(3 * surface.triangles.size());
  for (const auto& triangle : surface.triangles)
    for (const std::uint32_t corner : triangle)
      marker.points.push_back(to_message(surface.points_mm[corner]));
  return marker;
}

/// Namespace and colour of the markers of a pose of the CT that is no accepted alignment.
struct Mark {
  const char* name;
  float red;
  float green;
  float blue;
};
constexpr Mark kRefused{"REFUSED", 1.0F, 0.1F, 0.1F};
constexpr Mark kProposed{"PROPOSED", 1.0F, 0.75F, 0.1F};
constexpr Mark kNotInForce{"NOT IN FORCE", 0.7F, 0.7F, 0.7F};

void colour_as(const Mark& mark, double alpha, Marker& marker) {
  marker.ns = mark.name;
  marker.color.r = mark.red;
  marker.color.g = mark.green;
  marker.color.b = mark.blue;
  marker.color.a = static_cast<float>(alpha);
}

/// A marker that deletes those before, and the surfaces of the CT.
MarkerArray marked_surfaces(const MarkerArray& surfaces_ct, const std::string& frame,
                            const Eigen::Isometry3d& T_frame_ct, const Mark& mark, double alpha) {
  MarkerArray result;
  result.markers.push_back(deletes_all(frame));
  for (Marker marker : placed(surfaces_ct, frame, T_frame_ct, alpha).markers) {
    if (marker.action != Marker::ADD) continue;
    colour_as(mark, alpha, marker);
    result.markers.push_back(marker);
  }
  return result;
}

/// `id` must be negative, since the ids of surfaces are labels.
Marker marked_text(int id, const std::string& text, double letter_m, const std::string& frame,
                   const Eigen::Vector3d& at_mm, const Mark& mark) {
  Marker marker;
  marker.header.frame_id = frame;
  marker.id = id;
  marker.type = Marker::TEXT_VIEW_FACING;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.pose.position = to_message(at_mm);
  marker.scale.z = letter_m;
  colour_as(mark, 1.0, marker);
  marker.text = text;
  return marker;
}

std::string in_lines(const std::string& text) {
  constexpr std::size_t kLettersPerLine = 80;
  std::string lines;
  for (const std::string& line : wrapped(text, kLettersPerLine))
    lines += (lines.empty() ? "" : "\n") + line;
  return lines;
}

}  // namespace

MarkerArray to_markers(const std::map<int, Surface>& surfaces, const LabelTable& labels,
                       const std::string& frame, std::uint32_t ct_crc32) {
  MarkerArray array;
  array.markers.push_back(deletes_all(frame));
  array.markers.front().text = kOfCt + std::to_string(ct_crc32);
  for (const auto& [label, surface] : surfaces)
    array.markers.push_back(to_marker(label, surface, labels, frame));
  return array;
}

std::optional<std::uint32_t> ct_crc32_of(const MarkerArray& surfaces) {
  for (const Marker& marker : surfaces.markers) {
    if (marker.action != Marker::DELETEALL || marker.text.rfind(kOfCt, 0) != 0) continue;
    std::uint32_t crc32 = 0;
    const char* const begin = marker.text.data() + kOfCt.size();
    const char* const end = marker.text.data() + marker.text.size();
    const auto [last, error] = std::from_chars(begin, end, crc32);
    if (error == std::errc() && last == end) return crc32;
  }
  return std::nullopt;
}

Eigen::AlignedBox3d box_mm(const Marker& marker, const std::string& source) {
  const Eigen::Isometry3d T_frame_marker = from_message_mm(marker.pose, source);
  Eigen::AlignedBox3d box;
  for (const geometry_msgs::Point& p : marker.points)
    box.extend(T_frame_marker * point_from_message_mm(p));
  return box;
}

MarkerArray placed(const MarkerArray& surfaces_ct, const std::string& frame,
                   const std::optional<Eigen::Isometry3d>& T_frame_ct, double alpha) {
  MarkerArray result;
  if (!T_frame_ct) {
    result.markers.push_back(deletes_all(frame));
    return result;
  }
  result = surfaces_ct;
  const geometry_msgs::Pose pose = to_pose_message(*T_frame_ct);
  for (Marker& marker : result.markers) {
    marker.header.frame_id = frame;
    marker.pose = pose;
    marker.color.a = static_cast<float>(alpha);
  }
  return result;
}

MarkerArray refused_markers(const MarkerArray& surfaces_ct, const RefusedCandidate& refused,
                            double alpha) {
  MarkerArray result =
      marked_surfaces(surfaces_ct, refused.frame, refused.T_frame_ct, kRefused, alpha);
  result.markers.push_back(marked_text(-1, "REFUSED: not a registration", kTitleM, refused.frame,
                                       refused.title_mm, kRefused));
  result.markers.push_back(marked_text(-2, in_lines(refused.reason), kReasonM, refused.frame,
                                       refused.reason_mm, kRefused));
  return result;
}

MarkerArray proposed_markers(const MarkerArray& surfaces_ct, const ProposedAlignment& proposed,
                             double alpha) {
  MarkerArray result =
      marked_surfaces(surfaces_ct, proposed.frame, proposed.T_frame_ct, kProposed, alpha);
  if (proposed.text_mm)
    result.markers.push_back(marked_text(-1, "PROPOSED: " + in_lines(proposed.text), kReasonM,
                                         proposed.frame, *proposed.text_mm, kProposed));
  return result;
}

Marker not_in_force_marker(const std::string& reason, const std::string& frame,
                           const Eigen::Vector3d& at_mm) {
  return marked_text(-1, in_lines(reason), kReasonM, frame, at_mm, kNotInForce);
}

}  // namespace usct::ros_interface
