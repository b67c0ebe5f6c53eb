#pragma once

#include <sensor_msgs/PointCloud2.h>
#include <visualization_msgs/MarkerArray.h>

#include <map>
#include <string>

#include "us_ct_registration/rendering/surface.h"

/// Surfaces of the CT as messages. Their stamp is 0: they hold whenever tf knows the CT.
namespace usct::ros_interface {

/// Names of labels from a parameter's text, "1 kidney; 2 tumour". Throws InputError, naming
/// `source`, for an entry without number or name, a number that is not in [1, 65535] or comes
/// twice.
std::map<int, std::string> label_names_from(const std::string& text, const std::string& source);

/// "NUMBER NAME"; the name is "label" where none was given.
std::string label_text(int label, const std::map<int, std::string>& names);

/// First a marker that deletes those of the CT before; then a TRIANGLE_LIST per surface, whose id
/// is the label and whose namespace its name.
visualization_msgs::MarkerArray to_markers(const std::map<int, Surface>& surfaces,
                                           const std::map<int, std::string>& names,
                                           const std::string& frame);

/// The surfaces' points: x, y, z (float32, m) and label (uint32).
sensor_msgs::PointCloud2 to_points(const std::map<int, Surface>& surfaces,
                                   const std::string& frame);

}  // namespace usct::ros_interface
