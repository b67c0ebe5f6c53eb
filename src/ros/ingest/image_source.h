#pragma once

#include <image_transport/image_transport.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <sensor_msgs/Image.h>
#include <us_ct_registration/StatusCode.h>
#include <us_ct_registration/Sweep.h>

#include <deque>
#include <mutex>
#include <optional>
#include <string>

#include "ros/ingest/image_poses.h"
#include "ros/ingest/ingest_parameters.h"
#include "ros/ingest/ingest_source.h"
#include "ros/ingest/last_arrival.h"
#include "ros/ingest/volume_publisher.h"
#include "ros/node/guarded_queue.h"
#include "us_ct_registration/ultrasound/image_beams.h"
#include "us_ct_registration/ultrasound/image_sweep.h"

namespace usct::ros_interface {

/// Assembles live B-mode images to sweeps: resamples each along the beams of the probe, and at the
/// end of a sweep looks their poses up in tf, corrected for the lag that the sweep's images show.
class ImageSource : public IngestSource {
 public:
  /// Throws InputError if the probe does not lie in the images.
  ImageSource(const ::ros::NodeHandle& node, const ImageStreamOptions& options,
              VolumePublisher& volumes);

  void describe(diagnostic_updater::DiagnosticStatusWrapper& status) override;

 private:
  using Status = us_ct_registration::StatusCode;
  using Sweep = us_ct_registration::Sweep;
  using Answer = Sweep::Response;

  /// The sweep that is recorded.
  struct Recording {
    ImageSweep images;
    VolumePublisher::Id id;   // from its first image on
    std::string image_frame;  // empty until the first image arrives, if the images name it
  };

  void on_image(const sensor_msgs::ImageConstPtr& image);
  /// Adds an image to the sweep that is recorded. Throws InputError if the image is invalid.
  void take(const sensor_msgs::Image& image);
  /// Throws InputError for a stamp, frame or size that the node cannot use.
  void require_usable(const sensor_msgs::Image& image) const;
  void record(const sensor_msgs::Image& image);
  void notice_arrival(const ::ros::Time& now);
  void begin();
  /// The images have paused: where a pause delimits sweeps, the open one waits to be finished, and
  /// the images that follow are no longer those of a refused one.
  void pause();
  /// Waits until the images that were taken before this call have come in: 0.05 s and, on a busy
  /// machine, as long as it takes to resample those that wait.
  void await_images();
  /// Time since the last image arrived, s.
  double silent_s() const;
  void check_pause();
  /// Publishes the sweep, or says why not.
  Answer finish(const Recording& recording);
  void remember(const PlacedSweep& placed);
  /// `stamp`: of the sweep's last image; 0: none is known.
  Status refuse(const std::string& reason, const ::ros::Time& stamp, VolumePublisher::Id id);
  Answer start_sweep();
  Answer end_sweep();
  /// Why no sweep can start now; OK if it can.
  Status readiness();

  const ImageStreamOptions options_;
  const ImageBeams beams_;
  VolumePublisher& volumes_;
  const ImagePoses poses_;

  std::mutex finishing_;  // held while a sweep is finished, so that volumes keep their order

  std::mutex mutex_;  // guards the members below, up to reported_at_
  std::optional<Recording> recording_;
  std::deque<Recording> paused_;         // sweeps that a pause has ended, to be finished
  bool is_refused_until_pause_ = false;  // the images that come are those of a refused sweep
  std::uint32_t next_number_ = 0;
  std::string topic_;
  LastArrival last_arrival_;
  ::ros::Time last_stamp_;  // of the last usable image
  std::string last_frame_;
  std::string problem_;  // of the last image; empty if it was usable
  std::uint64_t received_ = 0;
  std::uint64_t refused_ = 0;
  Counts dropped_;
  std::string refusal_;             // of the last sweep; empty if it was published
  std::string warning_;             // of the last sweep that was published
  std::optional<LagEstimate> lag_;  // the best estimate so far
  std::string lag_text_;            // of the last sweep
  std::uint64_t reported_images_ = 0;
  ::ros::WallTime reported_at_;

  // One thread takes the images, in their order: await_images waits for it.
  ::ros::CallbackQueue image_queue_;
  GuardedQueue guarded_images_{image_queue_};

  // These members are last, because their callbacks use all others.
  image_transport::ImageTransport transport_;
  image_transport::Subscriber subscriber_;
  ::ros::ServiceServer start_server_;
  ::ros::ServiceServer end_server_;
  ::ros::WallTimer pause_timer_;
  ::ros::AsyncSpinner image_spinner_;
};

}  // namespace usct::ros_interface
