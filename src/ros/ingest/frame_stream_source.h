#pragma once

#include <ros/node_handle.h>
#include <us_ct_registration/PreScanFrame.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "ros/conversions/frames.h"
#include "ros/ingest/ingest_parameters.h"
#include "ros/ingest/ingest_source.h"
#include "ros/ingest/last_arrival.h"
#include "ros/ingest/volume_publisher.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"

namespace usct::ros_interface {

/// Poses of a tracked probe's array from tf.
class ArrayPoses {
 public:
  ArrayPoses(const ::ros::NodeHandle& node, const FrameStreamOptions& options);

  /// Sets the frame's pose at its stamp minus the image lag, or the reason why it has none. Waits
  /// for tf until `deadline`.
  void look_up(ReceivedFrame& frame, const ::ros::Time& deadline) const;

 private:
  const std::string us_frame_;
  const ::ros::Duration image_lag_;
  const double tf_wait_s_;
  TfBuffer buffer_;
  TfInput input_;
};

/// Assembles the frames of the topic `us/frames` to sweeps, and compares images with poses to find
/// an image lag that is not corrected.
class FrameStreamSource : public IngestSource {
 public:
  FrameStreamSource(::ros::NodeHandle node, const FrameStreamOptions& options,
                    VolumePublisher& volumes);

  void describe(diagnostic_updater::DiagnosticStatusWrapper& status) override;

 private:
  void on_frame(const ::ros::MessageEvent<us_ct_registration::PreScanFrame const>& event);
  std::vector<EndedSweep> assemble(const us_ct_registration::PreScanFrame::ConstPtr& message,
                                   const ::ros::Time& receipt);
  void check_pause();
  /// Publishes the assembled sweeps and logs the refused ones. `mutex_` must be held, so that
  /// volumes are published in the order of their sweeps.
  void publish(const std::vector<EndedSweep>& sweeps);
  /// Announces a sweep that has begun since the last call. `mutex_` must be held.
  void announce_recording();
  void check_lags(const std::vector<EndedSweep>& sweeps);
  void check_lag(const PreScanVolume& volume);
  void describe_frames(diagnostic_updater::DiagnosticStatusWrapper& status);

  const FrameStreamOptions options_;
  VolumePublisher& volumes_;
  std::unique_ptr<const ArrayPoses> poses_;  // null: tf is not asked

  std::mutex mutex_;  // guards the members below, up to reported_at_
  SweepAssembler assembler_;
  LastArrival last_arrival_;
  int frames_in_work_ = 0;
  std::uint64_t recording_number_ = 0;  // of the sweep that was announced last
  VolumePublisher::Id recording_id_;    // of the same, until it ends
  std::uint64_t refused_ = 0;
  std::string refusal_;  // of the last sweep; empty if it was published
  std::string lag_;      // estimate from the last tracked sweep
  std::string lag_warning_;
  std::uint64_t reported_frames_ = 0;
  ::ros::WallTime reported_at_;

  // These members are last, because their callbacks use all others.
  ::ros::Subscriber subscriber_;
  ::ros::WallTimer pause_timer_;
};

}  // namespace usct::ros_interface
