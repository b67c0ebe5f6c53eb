#include "ros/ingest/folder_source.h"

#include "ros/node/guarded_queue.h"
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
      passed_over_(folder_.passed_over()),
      timer_(node.createWallTimer(::ros::WallDuration(folder.period_s),
                                  guarded([this](const ::ros::WallTimerEvent&) { look(); }))) {
  if (passed_over_ > 0)
    ROS_INFO("%zu files were in the folder before the start, and are not read (folder_existing)",
             passed_over_);
}

void FolderSource::tell(std::string& what, const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  what = text;
}

bool FolderSource::is_done_with_first() try {
  if (!next_)
    next_.emplace(in_line_.front(), "file " + std::to_string(++taken_) + " of the watched folder",
                  file_);
  const ::ros::Time now = ::ros::Time::now();
  const std::string awaited = next_->awaited(now);
  tell(awaited_, awaited);
  if (!awaited.empty()) return false;
  volumes_.publish(next_->stamped(now));
  tell(file_error_, "");
  return true;
} catch (const std::exception& error) {
  tell(file_error_, error.what());
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
    tell(folder_error_, "");
  } catch (const std::exception& error) {
    ROS_ERROR_THROTTLE(10.0, "%s", error.what());
    tell(folder_error_, error.what());
  }
  for (; !in_line_.empty() && is_done_with_first(); in_line_.pop_front()) next_.reset();
}

void FolderSource::describe(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!awaited_.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, awaited_);
  for (const std::string& error : {file_error_, folder_error_})
    if (!error.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::ERROR, error);
  status.add("files passed over at the start", passed_over_);
}

}  // namespace usct::ros_interface
