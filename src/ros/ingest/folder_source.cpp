#include "ros/ingest/folder_source.h"

#include "ros/guarded_queue.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

double steady_s() { return ::ros::SteadyTime::now().toSec(); }

}  // namespace

FolderSource::FolderSource(::ros::NodeHandle node, const FileOptions& file,
                           const FolderOptions& folder, VolumePublisher& volumes)
    : file_(file),
      volumes_(volumes),
      folder_(file.ultrasound.path, folder.suffix, folder.settle_s, folder.take_existing,
              steady_s()),
      timer_(node.createWallTimer(::ros::WallDuration(folder.period_s),
                                  guarded([this](const ::ros::WallTimerEvent&) { look(); }))) {}

void FolderSource::tell(const std::string& error) {
  const std::lock_guard<std::mutex> lock(mutex_);
  error_ = error;
}

void FolderSource::tell_awaited(const std::string& awaited) {
  const std::lock_guard<std::mutex> lock(mutex_);
  awaited_ = awaited;
}

bool FolderSource::is_done_with_first() try {
  if (!next_)
    next_.emplace(in_line_.front(), "file " + std::to_string(++taken_) + " of the watched folder",
                  file_);
  const ::ros::Time now = ::ros::Time::now();
  const std::string awaited = next_->awaited(now);
  tell_awaited(awaited);
  if (!awaited.empty()) return false;
  volumes_.publish(next_->stamped(now));
  tell("");
  return true;
} catch (const std::exception& error) {
  tell(error.what());
  ROS_ERROR("%s", error.what());
  volumes_.announce_refused(error.what());
  return true;
}

void FolderSource::look() {
  // A file may take longer than the period; its callback then still runs on another thread.
  const std::unique_lock<std::mutex> looking(looking_, std::try_to_lock);
  if (!looking) return;
  try {
    for (std::filesystem::path& path : folder_.take(steady_s()))
      in_line_.push_back(std::move(path));
  } catch (const std::exception& error) {
    ROS_ERROR_THROTTLE(10.0, "%s", error.what());
    tell(error.what());
  }
  for (; !in_line_.empty() && is_done_with_first(); in_line_.pop_front()) next_.reset();
}

void FolderSource::describe(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!awaited_.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, awaited_);
  if (!error_.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::ERROR, error_);
}

}  // namespace usct::ros_interface
