#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "us_ct_registration/io/volumes/label_table.h"
#include "us_ct_registration/rendering/surface.h"

/// Surfaces as markers.
namespace usct::ros_interface {

/// A marker that deletes those of the previous CT, then a TRIANGLE_LIST per surface, with the label
/// as its id, and name and colour of the table. The stamp is 0, because they are valid at any time.
/// The `text` of the first marker says of which CT they are, by the CT's `crc32`.
visualization_msgs::MarkerArray to_markers(const std::map<int, Surface>& surfaces,
                                           const LabelTable& labels, const std::string& frame,
                                           std::uint32_t ct_crc32);

/// The checksum of the CT whose surfaces they are; unset if they do not say.
std::optional<std::uint32_t> ct_crc32_of(const visualization_msgs::MarkerArray& surfaces);

/// The box around the points of a marker, in the marker's frame, mm. Throws InputError, naming
/// `source`, if its pose is not rigid.
Eigen::AlignedBox3d box_mm(const visualization_msgs::Marker& marker, const std::string& source);

/// The markers of the CT's surfaces, transformed to another frame so that tf is not needed, with
/// opacity `alpha`. If the pose is not known, a marker that deletes all others in `frame`.
visualization_msgs::MarkerArray placed(const visualization_msgs::MarkerArray& surfaces_ct,
                                       const std::string& frame,
                                       const std::optional<Eigen::Isometry3d>& T_frame_ct,
                                       double alpha);

/// The best candidate of a refused registration, and where texts about it are shown, in `frame`.
struct RefusedCandidate {
  std::string frame;
  Eigen::Isometry3d T_frame_ct;
  std::string reason;
  Eigen::Vector3d title_mm;
  Eigen::Vector3d reason_mm;
};

/// What shows a refused candidate and cannot be taken for an alignment: a marker that deletes those
/// before, the surfaces of the CT in red with opacity `alpha`, and two texts, which say REFUSED and
/// why. The namespace of all is "REFUSED".
visualization_msgs::MarkerArray refused_markers(const visualization_msgs::MarkerArray& surfaces_ct,
                                                const RefusedCandidate& refused, double alpha);

/// An alignment that waits for a person, and where a text about it is shown, in `frame`.
struct ProposedAlignment {
  std::string frame;
  Eigen::Isometry3d T_frame_ct;
  std::string text;
  /// Empty: no text is shown.
  std::optional<Eigen::Vector3d> text_mm;
};

/// The same for an alignment that is not accepted yet: the surfaces and the text are amber, and the
/// namespace of all is "PROPOSED".
visualization_msgs::MarkerArray proposed_markers(const visualization_msgs::MarkerArray& surfaces_ct,
                                                 const ProposedAlignment& proposed, double alpha);

/// A text in place of the surfaces of an alignment that is not in force, at a point in `frame`:
/// grey, in the namespace "NOT IN FORCE", to be sent after a marker that deletes those before.
visualization_msgs::Marker not_in_force_marker(const std::string& reason, const std::string& frame,
                                               const Eigen::Vector3d& at_mm);

}  // namespace usct::ros_interface
