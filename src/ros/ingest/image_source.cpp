#include "ros/ingest/image_source.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "ros/conversions/frames.h"
#include "ros/conversions/images.h"
#include "ros/conversions/times.h"
#include "ros/ingest/sweep_words.h"
#include "ros/node/guarded_queue.h"
#include "ros/node/resolved_topic.h"
#include "ros/node/status.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;
using diagnostic_msgs::DiagnosticStatus;

/// A second of a fast scanner, in which the node may have to wait for a processor.
constexpr std::uint32_t kImageQueue = 100;

}  // namespace

ImageSource::ImageSource(const ::ros::NodeHandle& node, const ImageStreamOptions& options,
                         VolumePublisher& volumes)
    : options_(options),
      beams_(options.width, options.height, options.shown, options.sweep.array, options.sweep.axial,
             options.placement),
      volumes_(volumes),
      poses_(node, options),
      topic_(node.resolveName("us/image")),
      last_arrival_(node),
      reported_at_(::ros::WallTime::now()),
      transport_(node_for_resolved(with_queue(node, guarded_images_), topic_)),
      image_spinner_(1, &image_queue_) {
  subscriber_ = transport_.subscribe(
      topic_, kImageQueue, &ImageSource::on_image, this,
      image_transport::TransportHints(options.transport, ::ros::TransportHints().tcpNoDelay(),
                                      ::ros::NodeHandle(options.plugin_namespace)));
  ::ros::NodeHandle services(node);
  if (options_.by_service) {
    const auto serve = [&](const std::string& name, Answer (ImageSource::*answer)()) {
      return services.advertiseService<Sweep::Request, Sweep::Response>(
          name, [this, answer](Sweep::Request&, Sweep::Response& response) {
            response = (this->*answer)();
            return true;
          });
    };
    start_server_ = serve("us/start_sweep", &ImageSource::start_sweep);
    end_server_ = serve("us/end_sweep", &ImageSource::end_sweep);
  }
  pause_timer_ =
      services.createWallTimer(::ros::WallDuration(kPauseCheckPeriod_s),
                               guarded([this](const ::ros::WallTimerEvent&) { check_pause(); }));
  image_spinner_.start();
}

void ImageSource::notice_arrival(const ::ros::Time& now) {
  if (ran_back(now, last_arrival_.time()) && recording_) {
    refuse(recording_->images.name() + ": time ran back while it was recorded", {}, recording_->id);
    recording_.reset();
  }
  last_arrival_.set(now);
}

void ImageSource::await_images() {
  const ::ros::Time called = ::ros::Time::now();
  // Images of a recording that is replayed may all have earlier stamps.
  const ::ros::WallTime deadline = ::ros::WallTime::now() + ::ros::WallDuration(1.0);
  const auto seen = [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::pair(received_, last_stamp_);
  };
  for (auto before = seen();;) {
    ::ros::WallDuration(0.05).sleep();  // for those that are on their way
    wait_for_held(image_queue_);
    const auto now = seen();
    if (now.first == before.first || now.second > called || ::ros::WallTime::now() > deadline)
      return;
    before = now;
  }
}

double ImageSource::silent_s() const {
  return seconds_between(last_arrival_.time(), last_arrival_.now());
}

void ImageSource::begin() { recording_ = Recording{{options_.sweep, next_number_++}, {}, {}}; }

void ImageSource::pause() {
  if (options_.by_service) return;
  is_refused_until_pause_ = false;
  if (recording_) paused_.push_back(*std::exchange(recording_, std::nullopt));
}

void ImageSource::check_pause() {
  // Taken before the sweeps, so that no later sweep can be finished first.
  const std::lock_guard<std::mutex> finishing(finishing_);
  std::deque<Recording> ended;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (silent_s() > options_.sweep.longest_pause_s) pause();
    ended.swap(paused_);
  }
  for (const Recording& recording : ended) finish(recording);
}

void ImageSource::on_image(const sensor_msgs::ImageConstPtr& image) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++received_;
  // The timer may have had no time to notice a pause.
  if (silent_s() > options_.sweep.longest_pause_s) pause();
  notice_arrival(::ros::Time::now());
  try {
    take(*image);
    problem_.clear();
  } catch (const InputError& error) {
    ++dropped_["invalid"];
    problem_ = error.what();
    ROS_ERROR_THROTTLE(10.0, "%s", problem_.c_str());
  }
}

void ImageSource::require_usable(const sensor_msgs::Image& image) const {
  if (image.header.stamp.isZero())
    throw InputError(topic_, "'header.stamp' is 0, must be the time of the acquisition");
  require_not_ahead(image.header.stamp, ::ros::Time::now(), topic_, "header.stamp");
  if (options_.image_frame.empty() && image.header.frame_id.empty())
    throw InputError(topic_,
                     "'header.frame_id' is empty, must name the frame that moves with the "
                     "probe, or image_frame must");
  if (image.width != static_cast<std::uint32_t>(options_.width) ||
      image.height != static_cast<std::uint32_t>(options_.height))
    throw InputError(topic_, "an image has " + std::to_string(image.width) + " x " +
                                 std::to_string(image.height) + " pixels, must have " +
                                 std::to_string(options_.width) + " x " +
                                 std::to_string(options_.height) +
                                 " (image_size), for which the calibration holds");
  require_readable(image, topic_);
}

void ImageSource::take(const sensor_msgs::Image& image) {
  require_usable(image);
  // A recording that is replayed fast has pauses of the stamps alone.
  const double step_s = seconds_between(last_stamp_, image.header.stamp);
  if (step_s > options_.sweep.longest_pause_s) pause();
  if (is_refused_until_pause_)
    ++dropped_["of a refused sweep"];
  else if (recording_ || !options_.by_service)
    record(image);
  // A recording that begins again: its images are those of another sweep than the refused one.
  if (step_s < -options_.sweep.longest_pause_s) is_refused_until_pause_ = false;
  last_stamp_ = image.header.stamp;
  last_frame_ = options_.image_frame.empty() ? image.header.frame_id : options_.image_frame;
}

void ImageSource::record(const sensor_msgs::Image& image) {
  const std::vector<std::uint8_t> pixels = brightness_from(image, topic_);
  std::vector<std::uint8_t> brightness(beams_.size());
  beams_.resample(pixels.data(), brightness.data());
  if (!recording_) begin();
  const ::ros::Time acquired = shifted(image.header.stamp, -options_.sweep.image_lag_s);
  std::string& frame = recording_->image_frame;
  const std::string& its_frame =
      options_.image_frame.empty() ? image.header.frame_id : options_.image_frame;
  try {
    if (frame.empty()) frame = its_frame;
    if (frame != its_frame)
      throw InputError(recording_->images.name(), "the images' 'frame_id' changes from '" + frame +
                                                      "' to '" + its_frame + "'");
    const auto& images = recording_->images.images();
    if (!images.empty() && seconds_between(time_from(images.front().stamp_ns), image.header.stamp) >
                               options_.longest_sweep_s)
      throw InputError(
          recording_->images.name(),
          "it is longer than " + std::to_string(options_.longest_sweep_s) + " s (longest_sweep)");
    recording_->images.add(nanoseconds_from(image.header.stamp), std::move(brightness));
    if (images.size() == 1) recording_->id = volumes_.announce_recording(acquired);
  } catch (const InputError& error) {
    const VolumePublisher::Id id = recording_->id;
    recording_.reset();
    is_refused_until_pause_ = !options_.by_service;  // what is left of it is no sweep
    refuse(error.what(), acquired, id);
  }
}

ImageSource::Status ImageSource::refuse(const std::string& reason, const ::ros::Time& stamp,
                                        VolumePublisher::Id id) {
  ++refused_;
  refusal_ = reason;
  ROS_ERROR("refused %s", reason.c_str());
  volumes_.announce_refused(reason, stamp, id);
  return status(Code::FAILED, "refused " + reason);
}

ImageSource::Answer ImageSource::finish(const Recording& recording) {
  Answer answer;
  std::optional<LagEstimate> known;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    known = lag_;
  }
  try {
    const ::ros::WallTime deadline =
        ::ros::WallTime::now() + ::ros::WallDuration(options_.tf_wait_s);
    const PlacedSweep placed = place_images(
        recording.images,
        [&](std::int64_t stamp_ns) { return poses_.at(stamp_ns, recording.image_frame, deadline); },
        known);
    const msg::PreScanVolumePtr volume = volume_message(placed.assembled);
    const std::string text = described(placed, recording.images.name());
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      remember(placed);
    }
    volumes_.publish(volume, recording.id);
    ROS_INFO("%s", text.c_str());
    answer.status = status(Code::OK, text);
    answer.us_stamp = volume->header.stamp;
  } catch (const std::exception& error) {  // InputError, or memory
    const std::lock_guard<std::mutex> lock(mutex_);
    answer.status = refuse(error.what(), {}, recording.id);
  }
  return answer;
}

void ImageSource::remember(const PlacedSweep& placed) {
  refusal_.clear();
  warning_ = placed.warning;
  for (const auto& [reason, count] : placed.dropped) dropped_[reason] += count;
  lag_ = better_lag(lag_, placed.lag);
  lag_text_ = described(placed.lag);
  const double left_s = placed.lag.lag_s - placed.corrected_lag_s;
  const double allowed_s = options_.lag_tolerance_s + 2.0 * placed.lag.standard_error_s;
  if (placed.lag.determined && std::abs(left_s) > allowed_s)
    warning_ +=
        (warning_.empty() ? "" : "; ") +
        ("images lag poses by " + lag_text_ + ", but " + seconds_text(placed.corrected_lag_s) +
         " s is corrected (" + placed.lag_source + "): frames are displaced along the sweep");
  if (!warning_.empty()) ROS_WARN("%s", warning_.c_str());
}

ImageSource::Status ImageSource::readiness() {
  ::ros::Time stamp;
  std::string frame;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const double age_s = silent_s();
    if (received_ == 0 || age_s > options_.sweep.longest_pause_s)
      return status(
          Code::NO_ULTRASOUND,
          "no image arrives on '" + topic_ + "', which has " +
              std::to_string(subscriber_.getNumPublishers()) + " publishers" +
              (received_ == 0 ? "" : "; the last came " + seconds_text(age_s) + " s ago"));
    if (!problem_.empty()) return status(Code::INVALID_MESSAGE, problem_);
    stamp = last_stamp_;
    frame = last_frame_;
  }
  const ::ros::WallTime deadline = ::ros::WallTime::now() + ::ros::WallDuration(options_.tf_wait_s);
  const ArrayPoseThen then = poses_.at(nanoseconds_from(stamp), frame, deadline);
  if (!then.T_us_frame)
    return status(Code::TF_UNAVAILABLE,
                  "the image of " + seconds_text(stamp) + " has no pose: " + then.problem);
  return status(Code::OK, "");
}

ImageSource::Answer ImageSource::start_sweep() {
  Answer answer;
  answer.status = readiness();
  if (answer.status.code != Code::OK) return answer;
  wait_for_held(image_queue_);  // their images are from before the sweep
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string before =
      recording_ ? "; " + recording_->images.name() + " was not ended and is discarded" : "";
  begin();
  refusal_.clear();
  answer.status.message =
      recording_->images.name() + " is recorded until us/end_sweep is called" + before;
  ROS_INFO("%s", answer.status.message.c_str());
  return answer;
}

ImageSource::Answer ImageSource::end_sweep() {
  await_images();
  const std::lock_guard<std::mutex> finishing(finishing_);
  Answer answer;
  std::optional<Recording> ended;
  double silent = 0.0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    silent = silent_s();
    if (!recording_) {
      answer.status =
          status(Code::NOT_RUNNING, refusal_.empty()
                                        ? "no sweep is recorded; us/start_sweep starts one"
                                        : "no sweep is recorded any more: refused " + refusal_);
      return answer;
    }
    ended = std::exchange(recording_, std::nullopt);
  }
  answer = finish(*ended);
  // Another thread sends the announcement. The caller's next request must not be quicker.
  ::ros::WallDuration(0.02).sleep();
  if (answer.status.code == Code::OK && silent > options_.sweep.longest_pause_s)
    answer.status.message += "; the last image came " + seconds_text(silent) +
                             " s before the call: did the images stop before the probe did?";
  return answer;
}

void ImageSource::describe(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!warning_.empty()) diagnosis.mergeSummary(DiagnosticStatus::WARN, warning_);
  if (!refusal_.empty()) diagnosis.mergeSummary(DiagnosticStatus::WARN, "refused " + refusal_);
  if (!problem_.empty()) diagnosis.mergeSummary(DiagnosticStatus::WARN, problem_);
  const ::ros::WallTime now = ::ros::WallTime::now();
  const double elapsed_s = std::max((now - reported_at_).toSec(), 1e-3);
  diagnosis.add("images received", received_);
  diagnosis.add("image rate [1/s]", static_cast<double>(received_ - reported_images_) / elapsed_s);
  reported_at_ = now;
  reported_images_ = received_;
  for (const auto& [reason, count] : dropped_) diagnosis.add("dropped: " + reason, count);
  diagnosis.add("recording",
                recording_ ? recording_->images.name() + ", " +
                                 std::to_string(recording_->images.images().size()) + " images, " +
                                 std::to_string(recording_->images.distinct()) + " distinct"
                           : std::string("no"));
  diagnosis.add("sweeps refused", refused_);
  diagnosis.add("image_lag [s]", options_.sweep.image_lag_s);
  if (!lag_text_.empty()) diagnosis.add("lag by the images", lag_text_);
  if (lag_)
    diagnosis.add("lag in use [s]",
                  options_.sweep.correct_lag ? lag_->lag_s : options_.sweep.image_lag_s);
}

}  // namespace usct::ros_interface
