#include "ros/ingest/file_source.h"

#include <ros/console.h>

#include <utility>

#include "ros/conversions/message_limit.h"
#include "ros/node/data_root.h"
#include "ros/node/guarded_queue.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {

template <typename Step>
auto FileVolume::retelling(const Step& step) const try {
  return step();
} catch (const InputError& error) {
  throw std::runtime_error(without_names(error.what(), path_, shown_as_));
} catch (const std::exception& error) {  // memory, disk, a stamp before 1970
  throw std::runtime_error(shown_as_ + ": " + without_names(error.what(), path_, shown_as_));
}

FileVolume::FileVolume(std::filesystem::path path, std::string shown_as, const FileOptions& options)
    : path_(std::move(path)),
      shown_as_(std::move(shown_as)),
      options_(options),
      volume_(retelling([this] {
        UltrasoundSource source = options_.ultrasound;
        source.path = path_;
        std::vector<std::string> warnings;
        PreScanVolume volume = read_prescan_file(source, warnings);
        for (const std::string& warning : warnings)
          ROS_WARN("%s", without_names(warning, path_, shown_as_).c_str());
        return volume;
      })) {}

std::string FileVolume::awaited(const ::ros::Time& now) const {
  return ros_interface::awaited(options_.stamp, now, sweep_seconds(volume_));
}

us_ct_registration::PreScanVolumePtr FileVolume::stamped(const ::ros::Time& now) const {
  return retelling([&] {
    if (volume_.voxels.size() > kMostMessageBytes)
      throw InputError(path_.string(),
                       "has " + std::to_string(volume_.voxels.size()) + " samples, must have <= " +
                           std::to_string(kMostMessageBytes) + " to be sent in one message");
    return stamped_message(volume_, options_.frame_id, options_.stamp, now, path_.string());
  });
}

FileSource::FileSource(::ros::NodeHandle node, const FileOptions& options, VolumePublisher& volumes)
    : volumes_(volumes),
      volume_(std::in_place, options.ultrasound.path, options.ultrasound.path.string(), options) {
  publish_once_stamped();
  constexpr double kPeriod_s = 0.05;
  if (volume_)
    timer_ = node.createWallTimer(
        ::ros::WallDuration(kPeriod_s),
        guarded([this](const ::ros::WallTimerEvent&) { publish_once_stamped(); }));
}

void FileSource::publish_once_stamped() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ::ros::Time now = ::ros::Time::now();
  if (!volume_ || !volume_->awaited(now).empty()) return;
  volumes_.publish(volume_->stamped(now));
  volume_.reset();
  timer_.stop();
}

void FileSource::describe(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string waits_for = volume_ ? volume_->awaited(::ros::Time::now()) : "";
  if (!waits_for.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, waits_for);
}

}  // namespace usct::ros_interface
