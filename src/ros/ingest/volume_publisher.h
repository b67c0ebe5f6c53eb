#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/node_handle.h>
#include <us_ct_registration/PreScanVolume.h>

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

namespace usct::ros_interface {

/// Publishes volumes on `us/volume` (latched), and before that, on `us/announced`, what becomes of
/// the ultrasound that is acquired. May be called from any thread.
class VolumePublisher {
 public:
  explicit VolumePublisher(::ros::NodeHandle node);

  /// Number of a sweep that was announced while it is recorded; none for a file.
  using Id = std::optional<std::uint64_t>;

  /// A sweep has begun, with a frame of this stamp.
  Id announce_recording(const ::ros::Time& first_stamp);
  void publish(const us_ct_registration::PreScanVolumeConstPtr& volume, Id id = {});
  /// There will be no volume, for this reason. `stamp`: of the last frame, or 0 if it is not known.
  void announce_refused(const std::string& reason, const ::ros::Time& stamp = {}, Id id = {});

  void describe(diagnostic_updater::DiagnosticStatusWrapper& status) const;

 private:
  std::uint64_t next_id();
  void announce(std::uint8_t state, const ::ros::Time& stamp, std::uint64_t id,
                const std::string& reason = {});

  const ::ros::Publisher announcements_;
  const ::ros::Publisher volumes_;
  mutable std::mutex mutex_;  // guards the members below
  std::uint64_t last_id_ = 0;
  std::uint64_t published_ = 0;
  ::ros::Time last_stamp_;  // of a volume
};

}  // namespace usct::ros_interface
