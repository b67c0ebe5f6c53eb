#include "rviz/ct_scene.h"

#include <rviz/display.h>
#include <rviz/display_group.h>
#include <rviz/view_controller.h>
#include <rviz/view_manager.h>
#include <rviz/visualization_manager.h>

namespace usct::ros_interface {
namespace {

bool may_show_another_ct(const ::rviz::Display& display) {
  const QString kind = display.getClassId();
  return (kind == "rviz/MarkerArray" || kind == "rviz/PointCloud2") &&
         display.getName() != "landmarks";
}

}  // namespace

void CtScene::renew_displays(bool is_ct_alone) {
  ::rviz::DisplayGroup* displays = manager_.getRootDisplayGroup();
  for (int i = 0; i < displays->numDisplays(); ++i) {
    ::rviz::Display* display = displays->getDisplayAt(i);
    const bool is_shown = display->isEnabled() || hidden_.count(display) > 0;
    display->setEnabled(false);
    if (display->getName() == "CT alone")
      display->setEnabled(is_ct_alone);
    else if (is_shown && is_ct_alone && may_show_another_ct(*display))
      hidden_.insert(display);
    else
      display->setEnabled(is_shown);
  }
  if (!is_ct_alone) hidden_.clear();
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
