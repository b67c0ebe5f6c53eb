#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rviz/panel.h>
#include <sensor_msgs/Image.h>

#include <QElapsedTimer>
#include <QTimer>
#include <cstdint>
#include <map>
#include <string>

#include "ros/node/guarded_queue.h"
#include "ros/operator/node_watch.h"
#include "ros/operator/operator_state.h"
#include "ros/operator/service_calls.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"

class QLabel;
class QPlainTextEdit;
class QPushButton;

namespace usct::ros_interface {

class LandmarkBox;
class PictureView;

/// The panel of rviz from which a person registers and decides: buttons, the evidence in words, the
/// picture of fusion_view, landmarks, and what the nodes say of themselves. docs/rviz_panel.md.
///
/// All of it runs in the thread of the windows: the panel has a callback queue of its own, which a
/// timer empties, and calls services by ServiceCalls, so that no node can hold the windows up. tf
/// alone arrives in a thread of its own.
class RegistrationPanel : public ::rviz::Panel {
 public:
  RegistrationPanel();
  ~RegistrationPanel() override;

 protected:
  void onInitialize() override;

 private:
  void build();
  QWidget* build_decision();
  QPushButton* add_button(OperatorAction action, const char* name, const QString& text);
  void subscribe();
  /// Does what a button asks for.
  void request(OperatorAction action);
  void request_registration();
  void request_cancel();
  /// Asks tf_publisher; `name` as in `registration/accept`.
  void request_decision(OperatorAction action, const std::string& name);
  /// Shows the answer to a request, or the reason why there is none.
  void answered(OperatorAction action, const std::string& words, bool is_good);
  void take_picture(const sensor_msgs::ImageConstPtr& image);
  /// Handles what has arrived, and brings the widgets up to date.
  void tick();
  void show_decision();
  void show_nodes();
  double now_s() const;

  ::ros::CallbackQueue queue_;
  GuardedQueue guarded_{queue_};
  ::ros::NodeHandle node_;
  TfBuffer tf_;
  TfInput tf_input_{tf_, node_};
  OperatorState state_;
  NodeWatch nodes_;
  ServiceCalls calls_;
  QElapsedTimer clock_;
  double registering_since_s_ = 0.0;
  /// The number of the result that waits, and since when it is shown.
  std::uint64_t shown_id_ = 0;
  double shown_since_s_ = 0.0;
  std::map<OperatorAction, QPushButton*> buttons_;
  // Qt's parents own the widgets.
  QLabel* answer_ = nullptr;
  QLabel* in_force_ = nullptr;
  QLabel* headline_ = nullptr;
  QPlainTextEdit* evidence_ = nullptr;
  QLabel* picture_warning_ = nullptr;
  PictureView* picture_ = nullptr;
  LandmarkBox* landmarks_ = nullptr;
  QLabel* nodes_label_ = nullptr;
  ::ros::Subscriber alignment_;
  ::ros::Subscriber proposed_;
  ::ros::Subscriber result_;
  ::ros::Subscriber diagnostics_;
  ::ros::Subscriber image_;
  QTimer timer_;
};

}  // namespace usct::ros_interface
