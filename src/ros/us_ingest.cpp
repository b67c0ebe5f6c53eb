#include "ros/us_ingest.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "ros/conversions.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/ultrasound/image_lag.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using diagnostic_msgs::DiagnosticStatus;

constexpr unsigned kFrameQueue = 500;
constexpr double kPauseCheckPeriod_s = 0.05;
constexpr double kDiagnosticsPeriod_s = 0.25;
constexpr std::size_t kBytesPerMegabyte = 1000000;

double steady_s() { return ::ros::SteadyTime::now().toSec(); }

std::string seconds(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3f s", value);
  return text;
}

}  // namespace

void UsIngest::read_file_options(Parameters& parameters, Options& options) {
  options.ultrasound = read_ultrasound_source(parameters);
  options.frame_id = parameters.text("frame_id", "us");
  options.file_stamp =
      parameters.choice("file_stamp", "acquisition", {"acquisition", "reading"}) == "reading"
          ? FileStamp::kReading
          : FileStamp::kAcquisition;
  options.folder_period_s = parameters.number("folder_period", 0.5, 0.01, 60.0);
  options.folder_settle_s = parameters.number("folder_settle", 1.0, 0.0, 60.0);
  options.folder_suffix = parameters.text("folder_suffix", "");
  options.folder_existing = parameters.flag("folder_existing", false);
}

UsIngest::Options UsIngest::read_options(const ::ros::NodeHandle& private_node) {
  Parameters parameters(private_node);
  Options options;
  options.source = parameters.choice("source", "frames", {"file", "folder", "frames"});
  read_file_options(parameters, options);
  AssemblyOptions& assembly = options.assembly;
  assembly.sweep_pause_s = parameters.number("sweep_pause", 1.0, 0.1, 60.0);
  assembly.max_missing = parameters.number("max_missing", 0.1, 0.0, 0.9);
  assembly.max_frames = parameters.whole("max_frames", 2000, 2, 1000000);
  assembly.max_bytes = kBytesPerMegabyte *
                       static_cast<std::size_t>(parameters.whole("max_volume_mb", 1000, 1, 100000));
  assembly.image_lag_s = parameters.number("image_lag", 0.0, -2.0, 2.0);
  options.pose_frame = parameters.text("pose_frame", "");
  options.tf_wait_s = parameters.number("tf_wait", 0.5, 0.0, 10.0);
  options.lag_tolerance_s = parameters.number("lag_tolerance", 0.05, 0.0, 2.0);
  parameters.finish();
  const bool from_disk = options.source != "frames";
  if (from_disk && options.ultrasound.path.empty())
    throw InputError(private_node.resolveName("path"), "is empty, must name the " + options.source +
                                                           " (source is '" + options.source + "')");
  if (!from_disk && !options.ultrasound.path.empty())
    throw InputError(private_node.resolveName("path"),
                     "is set, must be empty where source is 'frames'");
  if (from_disk && options.frame_id.empty())
    throw InputError(private_node.resolveName("frame_id"), "is empty, must name a frame");
  return options;
}

UsIngest::UsIngest(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : options_(read_options(private_node)),
      assembler_(options_.assembly),
      reported_at_(::ros::WallTime::now()),
      diagnostics_(node, private_node, private_node.getNamespace()) {
  ::ros::NodeHandle handle(node);
  volume_publisher_ = handle.advertise<msg::PreScanVolume>("us/volume", 1, true);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("ultrasound", this, &UsIngest::report);
  const auto every = [&](double period_s, const std::function<void()>& work) {
    timers_.push_back(handle.createWallTimer(::ros::WallDuration(period_s),
                                             [work](const ::ros::WallTimerEvent&) { work(); }));
  };
  if (options_.source == "file") {
    take_file(options_.ultrasound.path);
    if (!file_error_.empty()) throw std::runtime_error(file_error_);
  } else if (options_.source == "folder") {
    folder_.emplace(options_.ultrasound.path, options_.folder_suffix, options_.folder_settle_s,
                    options_.folder_existing, steady_s());
    every(options_.folder_period_s, [this] { look_into_folder(); });
  } else {
    if (!options_.pose_frame.empty()) {
      tf_buffer_ = std::make_unique<tf2_ros::Buffer>();
      tf_listener_ = std::make_unique<tf2_ros::TransformListener>(*tf_buffer_, handle);
    }
    frame_subscriber_ = handle.subscribe("us/frames", kFrameQueue, &UsIngest::on_frame, this,
                                         ::ros::TransportHints().tcpNoDelay());
    every(kPauseCheckPeriod_s, [this] { check_pause(); });
  }
  every(kDiagnosticsPeriod_s, [this] { diagnostics_.update(); });
}

void UsIngest::look_up_pose(StreamedFrame& streamed, const ::ros::Time& receipt) const {
  const msg::PreScanFrame& frame = *streamed.frame;
  streamed.tf_frame_id = options_.pose_frame;
  if (tf_buffer_ == nullptr) {
    streamed.tf_error = "the frames carry no pose, and the parameter pose_frame is not set";
    return;
  }
  try {
    const ::ros::Time shown = frame.header.stamp - ::ros::Duration(options_.assembly.image_lag_s);
    // To tf the time zero is the newest, which is not the pose of this frame.
    if (frame.header.stamp.isZero() || shown.isZero()) return;
    const ::ros::Duration left = receipt + ::ros::Duration(options_.tf_wait_s) - ::ros::Time::now();
    const geometry_msgs::Transform T =
        tf_buffer_
            ->lookupTransform(options_.pose_frame, frame.header.frame_id, shown,
                              std::max(left, ::ros::Duration(0.0)))
            .transform;
    streamed.tf_pose.emplace();
    streamed.tf_pose->position.x = T.translation.x;
    streamed.tf_pose->position.y = T.translation.y;
    streamed.tf_pose->position.z = T.translation.z;
    streamed.tf_pose->orientation = T.rotation;
  } catch (const std::exception& error) {  // tf2's, or a time that cannot be expressed
    streamed.tf_error = error.what();
  }
}

void UsIngest::on_frame(const ::ros::MessageEvent<msg::PreScanFrame const>& event) {
  StreamedFrame streamed;
  streamed.frame = event.getConstMessage();
  const bool motorised = streamed.frame->geometry.type == msg::ProbeGeometry::MOTORISED_CURVILINEAR;
  {
    // While a frame waits for tf, the pause is not the sender's.
    const std::lock_guard<std::mutex> lock(mutex_);
    ++frames_in_work_;
  }
  if (!motorised && streamed.frame->pose_frame_id.empty())
    look_up_pose(streamed, event.getReceiptTime());
  std::vector<msg::PreScanVolumeConstPtr> volumes;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    --frames_in_work_;
    volumes = publish(assembler_.add(streamed, ::ros::Time::now()));
  }
  for (const auto& volume : volumes) check_lag(*volume);
}

void UsIngest::check_pause() {
  std::vector<msg::PreScanVolumeConstPtr> volumes;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (frames_in_work_ > 0) return;
    volumes = publish(assembler_.end_after_pause(::ros::Time::now()));
  }
  for (const auto& volume : volumes) check_lag(*volume);
}

std::vector<msg::PreScanVolumeConstPtr> UsIngest::publish(const std::vector<EndedSweep>& sweeps) {
  std::vector<msg::PreScanVolumeConstPtr> volumes;
  for (const EndedSweep& sweep : sweeps) {
    refusal_ = sweep.volume ? "" : sweep.message;
    if (!sweep.volume) {
      ++refused_;
      ROS_ERROR("refused %s", sweep.message.c_str());
      continue;
    }
    if (!sweep.message.empty())
      ROS_WARN("sweep %u: left out %s", sweep.number, sweep.message.c_str());
    ROS_INFO("sweep %u: %u frames", sweep.number, sweep.volume->frames);
    publish(sweep.volume);
    volumes.push_back(sweep.volume);
  }
  return volumes;
}

void UsIngest::publish(const msg::PreScanVolumeConstPtr& volume) {
  volume_publisher_.publish(volume);
  ++published_;
  last_volume_stamp_ = volume->header.stamp;
}

void UsIngest::check_lag(const msg::PreScanVolume& message) {
  if (message.frame_poses.empty()) return;
  // The poses are corrected by image_lag already: what is found is what was left.
  const LagEstimate left = estimate_lag(from_message(message, "us/volume"));
  const double lag_s = options_.assembly.image_lag_s + left.lag_s;
  const double allowed_s = options_.lag_tolerance_s + 2.0 * left.standard_error_s;
  std::string text = "not determinable: " + left.message;
  std::string warning;
  if (left.determined) text = seconds(lag_s) + ", standard error " + seconds(left.standard_error_s);
  if (left.determined && std::abs(left.lag_s) > allowed_s)
    warning = "images lag poses by " + text + ", but image_lag is " +
              seconds(options_.assembly.image_lag_s) + ": frames are displaced along the sweep";
  if (!warning.empty()) ROS_WARN("%s", warning.c_str());
  const std::lock_guard<std::mutex> lock(mutex_);
  lag_ = text;
  lag_warning_ = warning;
}

void UsIngest::take_file(const std::filesystem::path& path) {
  UltrasoundSource source = options_.ultrasound;
  source.path = path;
  std::string failure;
  msg::PreScanVolumePtr volume;
  try {
    std::vector<std::string> warnings;
    volume = read_volume_message(source, options_.frame_id, options_.file_stamp, ::ros::Time::now(),
                                 warnings);
    for (const std::string& warning : warnings) ROS_WARN("%s", warning.c_str());
  } catch (const InputError& error) {
    failure = error.what();
  } catch (const std::exception& error) {  // memory, disk, a stamp before the epoch
    failure = path.string() + ": " + error.what();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  file_error_ = failure;
  if (volume) publish(volume);
}

void UsIngest::look_into_folder() {
  const std::unique_lock<std::mutex> looking(folder_mutex_, std::try_to_lock);
  if (!looking) return;
  try {
    for (const std::filesystem::path& path : folder_->take(steady_s())) {
      take_file(path);
      if (!file_error_.empty()) ROS_ERROR("%s", file_error_.c_str());
    }
  } catch (const InputError& error) {
    ROS_ERROR_THROTTLE(10.0, "%s", error.what());
    const std::lock_guard<std::mutex> lock(mutex_);
    file_error_ = error.what();
  }
}

void UsIngest::report(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status.summary(DiagnosticStatus::OK,
                 published_ > 0 ? "volumes published" : "waiting for ultrasound");
  if (!lag_warning_.empty()) status.mergeSummary(DiagnosticStatus::WARN, lag_warning_);
  if (!refusal_.empty()) status.mergeSummary(DiagnosticStatus::WARN, "refused " + refusal_);
  if (!file_error_.empty()) status.mergeSummary(DiagnosticStatus::ERROR, file_error_);
  status.add("source", options_.source);
  status.add("volumes published", published_);
  if (published_ > 0)
    status.add("age of the last volume [s]", (::ros::Time::now() - last_volume_stamp_).toSec());
  if (options_.source != "frames") return;
  const ::ros::WallTime now = ::ros::WallTime::now();
  const double elapsed_s = std::max((now - reported_at_).toSec(), 1e-3);
  status.add("frames received", assembler_.received());
  status.add("frame rate [1/s]",
             static_cast<double>(assembler_.received() - reported_frames_) / elapsed_s);
  reported_at_ = now;
  reported_frames_ = assembler_.received();
  for (const auto& [reason, count] : assembler_.dropped()) status.add("dropped: " + reason, count);
  status.add("sweeps refused", refused_);
  if (!assembler_.last_problem().empty()) status.add("last problem", assembler_.last_problem());
  status.add("image_lag [s]", options_.assembly.image_lag_s);
  if (!lag_.empty()) status.add("lag by the images", lag_);
}

}  // namespace usct::ros_interface
