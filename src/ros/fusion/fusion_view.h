#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/PointStamped.h>
#include <ros/ros.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/CtVolume.h>
#include <us_ct_registration/PreScanVolume.h>
#include <us_ct_registration/RegistrationResult.h>
#include <us_ct_registration/SaveFusion.h>
#include <us_ct_registration/SetFusionMode.h>
#include <visualization_msgs/MarkerArray.h>

#include <array>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "ros/fusion/fusion_painter.h"
#include "ros/fusion/fusion_scene.h"
#include "ros/fusion/ultrasound_placer.h"
#include "ros/node/data_root.h"
#include "ros/node/parameters.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"
#include "ros/tf/tf_wait.h"

namespace usct::ros_interface {

/// Publishes three planes of the ultrasound with the CT where the registration has it: wires topics
/// and services to FusionSceneKeeper and FusionPainter, which draws in a thread of its own while
/// somebody subscribes or asks. docs/nodes/fusion_view.md.
class FusionViewNode {
 public:
  FusionViewNode(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);
  ~FusionViewNode();

 private:
  /// A drawn view, and the number of the state in which it was drawn.
  struct Drawn {
    FusionView view;
    std_msgs::Header header;
    std::uint64_t state = 0;
  };

  void read_parameters(Parameters& parameters, const ::ros::NodeHandle& private_node);
  void advertise();
  void subscribe();

  void take_ultrasound(const us_ct_registration::PreScanVolumeConstPtr& message);
  void take_ct(const us_ct_registration::CtVolumeConstPtr& message);
  void take_centre(const geometry_msgs::PointStampedConstPtr& message);
  bool set_mode(us_ct_registration::SetFusionMode::Request& request,
                us_ct_registration::SetFusionMode::Response& response);
  bool save(us_ct_registration::SaveFusion::Request& request,
            us_ct_registration::SaveFusion::Response& response);

  /// Has the view drawn again if tf has lost the alignment that is in force, has it again, or has
  /// come to know where the ultrasound was.
  void follow_tf();
  /// The point in the fixed frame of the ultrasound; nothing if it is not finite. Throws an
  /// exception that says why its place is not known.
  std::optional<FramedPoint> placed(const geometry_msgs::PointStamped& message,
                                    const std::string& fixed) const;
  /// Changes the state with `change`, which gets the keeper, and has the view drawn again.
  template <typename Change>
  void update(const Change& change);
  /// A subscriber has come.
  void show(const ::ros::SingleSubscriberPublisher& subscriber, Picture FusionView::*picture);

  void run();
  /// Draws one scene. `lock` is released meanwhile.
  void draw(FusionPainter& painter, std::unique_lock<std::mutex>& lock);
  void publish(const Drawn& drawn) const;
  bool is_wanted() const;
  /// The sheet as it is now, drawn if need be. Throws Refusal.
  Picture newest_sheet();
  /// Writes the newest sheet into the file that a caller names. Throws Refusal, PathRefused or
  /// InputError.
  void save_as(const std::string& given);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis);

  ::ros::NodeHandle node_;
  std::string fixed_frame_;
  double pixel_mm_ = 0.0;
  double tf_timeout_s_ = 0.0;
  std::optional<DataRoot> save_root_;
  FusionSceneOptions scene_options_;
  TfBuffer tf_{::ros::Duration(kTfHistory_s)};
  std::unique_ptr<TfInput> tf_input_;

  std::mutex placing_;  // held while ultrasound is placed and taken; guards placer_
  std::unique_ptr<UltrasoundPlacer> placer_;

  std::mutex mutex_;  // guards the members below, up to seconds_
  std::condition_variable changed_;
  std::unique_ptr<FusionSceneKeeper> keeper_;
  std::uint64_t state_ = 1;        // rises with each change
  std::uint64_t drawn_state_ = 0;  // the state that was drawn last, or in which that failed
  std::shared_ptr<const Drawn> drawn_;
  int waiting_ = 0;  // services that wait for a drawing
  bool is_ending_ = false;
  std::string ultrasound_problem_;
  std::string problem_;
  std::string centre_problem_;
  std::string headline_;
  std::uint64_t drawings_ = 0;
  double seconds_ = 0.0;

  std::array<::ros::Publisher, 4> publishers_;
  std::vector<::ros::Subscriber> subscribers_;
  ::ros::ServiceServer mode_server_;
  ::ros::ServiceServer save_server_;
  diagnostic_updater::Updater diagnostics_;
  ::ros::WallTimer tf_timer_;
  ::ros::WallTimer diagnostics_timer_;
  std::thread thread_;  // last: it uses the members above
};

}  // namespace usct::ros_interface
