#pragma once

#include <geometry_msgs/PointStamped.h>
#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Core>
#include <QGroupBox>
#include <memory>
#include <string>

#include "ros/operator/landmark_pairs.h"
#include "ros/operator/service_calls.h"

class QLabel;
class QPushButton;
class QTableWidget;

namespace rviz {
class VisualizationManager;
}

namespace usct::ros_interface {

class CtScene;

/// The part of the panel that collects landmarks from rviz's tool Publish Point, shows them, and
/// sends them as the initial alignment of the next registrations.
class LandmarkBox : public QGroupBox {
 public:
  /// Subscribes by `node`. `calls` must outlive the box.
  LandmarkBox(::ros::NodeHandle& node, ServiceCalls& calls);
  ~LandmarkBox() override;

  /// Lets the box show the CT alone in rviz.
  void use(::rviz::VisualizationManager& manager);

 private:
  void build();
  void take_point(const geometry_msgs::PointStampedConstPtr& message);
  void take_surface(const visualization_msgs::MarkerArrayConstPtr& message);
  void show_ct(bool is_alone);
  void send();
  /// Brings the table, the hint and rviz's markers up to date.
  void refresh();
  void say(const std::string& words);

  ::ros::NodeHandle& node_;
  ServiceCalls& calls_;
  LandmarkPairs pairs_;
  /// Middle of the CT's surfaces, CT frame, m.
  Eigen::Vector3d ct_middle_m_ = Eigen::Vector3d::Zero();
  std::unique_ptr<CtScene> scene_;
  QPushButton* show_ct_ = nullptr;
  QTableWidget* table_ = nullptr;
  QPushButton* remove_ = nullptr;
  QPushButton* send_ = nullptr;
  QLabel* hint_ = nullptr;
  ::ros::Publisher markers_;
  ::ros::Subscriber ct_;
  ::ros::Subscriber surface_;
  ::ros::Subscriber points_;
};

}  // namespace usct::ros_interface
