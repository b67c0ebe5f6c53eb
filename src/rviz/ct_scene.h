#pragma once

#include <rviz/config.h>

#include <Eigen/Core>
#include <QString>
#include <optional>
#include <string>

namespace rviz {
class VisualizationManager;
}

namespace usct::ros_interface {

/// Shows the CT alone in rviz, in the CT's own frame, which tf need not connect to any other: so a
/// person can show points in it before the first registration.
class CtScene {
 public:
  /// `manager` must outlive this object.
  explicit CtScene(::rviz::VisualizationManager& manager) : manager_(manager) {}

  /// Makes `ct_frame` rviz's fixed frame, enables the display with the name "CT alone", if there is
  /// one, and makes the view look at `middle_m`, in the CT's frame, m.
  void show_ct_alone(const std::string& ct_frame, const Eigen::Vector3d& middle_m);
  /// Undoes the above.
  void show_all();

 private:
  /// Shows or hides the display "CT alone", and has all displays subscribe once more: with another
  /// fixed frame rviz has forgotten what they got, and the topics are latched.
  void renew_displays(bool is_ct_alone);

  ::rviz::VisualizationManager& manager_;
  /// The fixed frame and the view that were there before; empty while they are shown.
  std::optional<QString> fixed_frame_;
  ::rviz::Config view_;
};

}  // namespace usct::ros_interface
