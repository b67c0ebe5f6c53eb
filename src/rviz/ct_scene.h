#pragma once

#include <rviz/config.h>

#include <Eigen/Core>
#include <QString>
#include <optional>
#include <set>
#include <string>

namespace rviz {
class Display;
class VisualizationManager;
}  // namespace rviz

namespace usct::ros_interface {

/// Shows the CT alone in rviz, in the CT's own frame, which tf need not connect to any other: so a
/// person can show points in it before the first registration.
class CtScene {
 public:
  /// `manager` must outlive this object.
  explicit CtScene(::rviz::VisualizationManager& manager) : manager_(manager) {}

  /// Makes `ct_frame` rviz's fixed frame, enables the display with the name "CT alone", if there is
  /// one, hides all other clouds and markers but "landmarks", which would show the CT where tf or a
  /// registration has it as well, and makes the view look at `middle_m`, in the CT's frame, m.
  void show_ct_alone(const std::string& ct_frame, const Eigen::Vector3d& middle_m);
  /// Undoes the above.
  void show_all();

 private:
  /// Enables the displays as above, or as they were, and has them subscribe once more: with another
  /// fixed frame rviz has forgotten what they got, and the topics are latched.
  void renew_displays(bool is_ct_alone);

  ::rviz::VisualizationManager& manager_;
  /// The fixed frame and the view that were there before; empty while they are shown.
  std::optional<QString> fixed_frame_;
  /// The displays that it hides.
  std::set<const ::rviz::Display*> hidden_;
  ::rviz::Config view_;
};

}  // namespace usct::ros_interface
