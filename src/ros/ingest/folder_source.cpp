#include "ros/ingest/folder_source.h"

#include "ros/ingest/file_source.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

double steady_s() { return ::ros::SteadyTime::now().toSec(); }

}  // namespace

FolderSource::FolderSource(::ros::NodeHandle node, const FileOptions& file,
                           const FolderOptions& folder, PublishVolume publish)
    : file_(file),
      publish_(std::move(publish)),
      folder_(file.ultrasound.path, folder.suffix, folder.settle_s, folder.take_existing,
              steady_s()),
      timer_(node.createWallTimer(::ros::WallDuration(folder.period_s),
                                  [this](const ::ros::WallTimerEvent&) { look(); })) {}

std::string FolderSource::awaited_clock() const {
  constexpr double kAnySweep_s = 0.0;
  return awaited(file_.stamp, ::ros::Time::now(), kAnySweep_s);
}

void FolderSource::set_error(const std::string& error) {
  const std::lock_guard<std::mutex> lock(mutex_);
  error_ = error;
}

void FolderSource::take(const std::filesystem::path& path) try {
  const std::string shown_as = "file " + std::to_string(++taken_) + " of the watched folder";
  publish_(FileVolume(path, shown_as, file_).stamped(::ros::Time::now()));
  set_error("");
} catch (const std::exception& error) {
  set_error(error.what());
  ROS_ERROR("%s", error.what());
}

void FolderSource::look() {
  // A file may take longer than the period; its callback then still runs on another thread.
  const std::unique_lock<std::mutex> looking(looking_, std::try_to_lock);
  if (!looking || !awaited_clock().empty()) return;
  try {
    for (const std::filesystem::path& path : folder_.take(steady_s())) take(path);
  } catch (const std::exception& error) {
    ROS_ERROR_THROTTLE(10.0, "%s", error.what());
    set_error(error.what());
  }
}

void FolderSource::describe(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string waits_for = awaited_clock();
  if (!waits_for.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, waits_for);
  if (!error_.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::ERROR, error_);
}

}  // namespace usct::ros_interface
