#include "rviz/ct_scene.h"

#include <rviz/display.h>
#include <rviz/display_group.h>
#include <rviz/view_controller.h>
#include <rviz/view_manager.h>
#include <rviz/visualization_manager.h>

namespace usct::ros_interface {

void CtScene::renew_displays(bool is_ct_alone) {
  ::rviz::DisplayGroup* displays = manager_.getRootDisplayGroup();
  for (int i = 0; i < displays->numDisplays(); ++i) {
    ::rviz::Display* display = displays->getDisplayAt(i);
    const bool is_shown = display->getName() == "CT alone" ? is_ct_alone : display->isEnabled();
    display->setEnabled(false);
    display->setEnabled(is_shown);
  }
}

void CtScene::show_ct_alone(const std::string& ct_frame, const Eigen::Vector3d& middle_m) {
  ::rviz::ViewController* view = manager_.getViewManager()->getCurrent();
  if (!fixed_frame_) {
    fixed_frame_ = manager_.getFixedFrame();
    view_ = ::rviz::Config();
    view->save(view_);
  }
  manager_.setFixedFrame(QString::fromStdString(ct_frame));
  renew_displays(true);
  constexpr double kDistanceM = 0.33;
  view->subProp("Target Frame")->setValue("<Fixed Frame>");
  ::rviz::Property* focus = view->subProp("Focal Point");
  focus->subProp("X")->setValue(middle_m.x());
  focus->subProp("Y")->setValue(middle_m.y());
  focus->subProp("Z")->setValue(middle_m.z());
  view->subProp("Distance")->setValue(kDistanceM);
}

void CtScene::show_all() {
  if (!fixed_frame_) return;
  manager_.setFixedFrame(*fixed_frame_);
  renew_displays(false);
  manager_.getViewManager()->getCurrent()->load(view_);
  fixed_frame_.reset();
}

}  // namespace usct::ros_interface
