#include "ros/alignment/tf_publisher.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "ros/alignment/alignment_diagnosis.h"
#include "ros/conversions/alignment.h"
#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "ros/node/parameters.h"
#include "ros/node/status.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/results/alignment_file.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;

/// A result's number may be ahead of this machine's clock by this much.
constexpr std::int64_t kClockToleranceMs = 100;
constexpr std::int64_t kNsPerMs = 1'000'000;
/// Within this time a result comes on its topic after the caller of a registration has its answer.
constexpr std::chrono::seconds kOnItsWay{2};

/// Of the wall clock: simulated time may jump back, and says nothing over a restart.
std::int64_t now_ns() { return static_cast<std::int64_t>(::ros::WallTime::now().toNSec()); }

}  // namespace

TfPublisher::TfPublisher(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : started_ns_(now_ns()),
      node_(node),
      diagnostics_(node, private_node, private_node.getNamespace()) {
  constexpr double kLongestAgeS = 7.0 * 24.0 * 3600.0;
  Parameters parameters(private_node);
  AlignmentDecisions::Options options;
  options.fixed_frame = parameters.frame("fixed_frame", "");
  policy_ = parameters.choice("policy", "confirm", {"auto", "confirm"});
  options.accept_at_once = policy_ == "auto";
  options.restore_at_once =
      parameters.choice("restore", "confirm", {"same_ct", "confirm"}) == "same_ct";
  options.restore_max_age_s =
      parameters.number("restore_max_age", options.restore_max_age_s, 0.0, kLongestAgeS);
  alignment_file_ = parameters.text("alignment_file", "");
  proposed_frame_ = parameters.frame("proposed_frame", "ct_proposed");
  AlignmentBroadcaster::Options broadcasts;
  broadcasts.rate_hz = parameters.number("rate", broadcasts.rate_hz, 1.0, 1000.0);
  broadcasts.tolerance_s =
      parameters.number("transform_tolerance", broadcasts.tolerance_s, 0.0, 10.0);
  const double diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  if (broadcasts.tolerance_s * broadcasts.rate_hz < 1.0)
    throw InputError(private_node.resolveName("transform_tolerance"),
                     "is " + std::to_string(broadcasts.tolerance_s) +
                         " s, must be >= 1 / rate = " + std::to_string(1.0 / broadcasts.rate_hz) +
                         " s, or look-ups fail between broadcasts");
  tolerance_ = ::ros::WallDuration(broadcasts.tolerance_s);
  decisions_ = AlignmentDecisions(options);
  restore();
  broadcaster_ = std::make_unique<AlignmentBroadcaster>(node_, broadcasts, watch_);
  proposed_broadcaster_ = std::make_unique<AlignmentBroadcaster>(node_, broadcasts, watch_);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("alignment", this, &TfPublisher::diagnose);
  advertise();
  subscribe();
  constexpr double kTfPeriodS = 0.05;
  tf_timer_ = node_.createWallTimer(::ros::WallDuration(kTfPeriodS),
                                    guarded([this](const ::ros::WallTimerEvent&) { check_tf(); }));
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); }));
  pose_timer_ =
      node_.createWallTimer(::ros::WallDuration(1.0), guarded([this](const ::ros::WallTimerEvent&) {
                              const std::lock_guard<std::mutex> lock(mutex_);
                              publish_pose(decisions_.state());
                            }));
}

void TfPublisher::advertise() {
  static_assert(+Decide::Request::KEPT == AlignmentDecisions::kKept);
  alignment_publisher_ = node_.advertise<msg::Alignment>("registration/alignment", 1, true);
  proposed_publisher_ = node_.advertise<msg::Alignment>("registration/proposed", 1, true);
  // These two are not latched: nobody could take a latched pose back once it holds no more.
  pose_publisher_ =
      node_.advertise<geometry_msgs::PoseWithCovarianceStamped>("registration/pose", 10);
  transform_publisher_ =
      node_.advertise<geometry_msgs::TransformStamped>("registration/transform", 10);
  show();
  accept_server_ = node_.advertiseService<Decide::Request, Decide::Response>(
      "registration/accept", [this](Decide::Request& request, Decide::Response& response) {
        await_result(request.result_id);
        return decide([&](AlignmentDecisions& d) { return d.accept(request.result_id, now_ns()); },
                      response);
      });
  reject_server_ = node_.advertiseService<Decide::Request, Decide::Response>(
      "registration/reject", [this](Decide::Request& request, Decide::Response& response) {
        await_result(request.result_id);
        return decide([&](AlignmentDecisions& d) { return d.reject(request.result_id); }, response);
      });
  revert_server_ = node_.advertiseService<Decide::Request, Decide::Response>(
      "registration/revert", [this](Decide::Request&, Decide::Response& response) {
        return decide([](AlignmentDecisions& d) { return d.revert(); }, response);
      });
}

void TfPublisher::subscribe() {
  constexpr std::uint32_t kTfQueue = 1000;
  tf_static_subscriber_ = node_.subscribe<tf2_msgs::TFMessage>(
      "/tf_static", kTfQueue,
      ::boost::function<void(const TfEvent&)>([this](const TfEvent& e) { on_tf(e, true); }));
  tf_subscriber_ = node_.subscribe<tf2_msgs::TFMessage>(
      "/tf", kTfQueue,
      ::boost::function<void(const TfEvent&)>([this](const TfEvent& e) { on_tf(e, false); }));
  ct_subscriber_ = node_.subscribe<msg::CtInfo>(
      "ct/info", 1, [this](const msg::CtInfoConstPtr& info) { on_ct(CtSource::kServer, info); });
  registered_ct_subscriber_ = node_.subscribe<msg::CtInfo>(
      "registration/ct", 1,
      [this](const msg::CtInfoConstPtr& info) { on_ct(CtSource::kRegistration, info); });
  result_subscriber_ = node_.subscribe("registration/result", 10, &TfPublisher::on_result, this);
}

void TfPublisher::restore() {
  if (alignment_file_.empty()) return;
  try {
    const DecisionAnswer answer = decisions_.restore(read_alignment(alignment_file_), now_ns());
    if (answer.is_done()) return;
    if (answer.code == DecisionAnswer::Code::kNothingToDecide) {
      last_refusal_ = answer.message;
      ROS_WARN("alignment_file: %s", last_refusal_.c_str());
      return;
    }
    file_error_ = answer.message;
  } catch (const std::exception& error) {
    file_error_ = error.what();
  }
  // The node starts nevertheless, because otherwise no new result could be accepted either.
  ROS_ERROR("alignment_file: %s", file_error_.c_str());
}

void TfPublisher::store(const StoredAlignment& stored) {
  if (alignment_file_.empty()) return;
  write_alignment(stored, alignment_file_);
  file_error_.clear();
}

std::string TfPublisher::why_ask(const msg::RegistrationResult& result) const {
  const auto result_ms = static_cast<std::int64_t>(result.id);
  if (result_ms <= started_ns_ / kNsPerMs)
    return "it is from before tf_publisher was started, and may have been given up since";
  const std::int64_t ahead_ms = result_ms - now_ns() / kNsPerMs;
  if (ahead_ms > kClockToleranceMs)
    return "its time is " + seconds_text(1e-3 * static_cast<double>(ahead_ms)) +
           " s ahead of this machine's clock, so that it may be from before tf_publisher was "
           "started; let the clocks agree";
  return watch_.conflict(result.fixed_frame, result.ct_frame, TfWatch::Clock::now());
}

std::string TfPublisher::conflict(const AlignmentState& state) const {
  if (!state.broadcast) return "";
  return watch_.conflict(state.broadcast->fixed_frame, state.broadcast->ct_frame,
                         TfWatch::Clock::now());
}

msg::StatusCode TfPublisher::apply(const Change& change) {
  AlignmentDecisions changed = decisions_;
  const DecisionAnswer answer = change(changed);
  if (!answer.is_done()) return to_message(answer);
  if (const std::string reason = conflict(changed.state()); !reason.empty())
    return status(Code::INVALID_REQUEST, "nothing is changed: " + reason);
  try {
    if (!(changed.stored() == decisions_.stored())) store(changed.stored());
  } catch (const std::exception& error) {
    file_error_ = error.what();
    return status(Code::FILE_ERROR,
                  "nothing is changed, for it could not be stored: " + file_error_);
  }
  decisions_ = changed;
  last_refusal_.clear();
  return to_message(answer);
}

void TfPublisher::on_result(const msg::RegistrationResultConstPtr& result) {
  const std::lock_guard<std::mutex> lock(mutex_);
  take(*result);
  newest_id_ = std::max(newest_id_, result->id);
  result_came_.notify_all();
}

void TfPublisher::await_result(std::uint64_t result_id) {
  std::unique_lock<std::mutex> lock(mutex_);
  result_came_.wait_for(lock, kOnItsWay, [&] {
    return result_id <= newest_id_ || result_id == AlignmentDecisions::kKept;
  });
}

void TfPublisher::take(const msg::RegistrationResult& result) {
  try {
    const std::string source = "result " + std::to_string(result.id) + " is refused";
    for (const auto& [stamp, field] :
         {std::pair(result.header.stamp, "header.stamp"), std::pair(result.us_stamp, "us_stamp")})
      require_not_ahead(stamp, ::ros::Time::now(), source, field);
  } catch (const InputError& error) {
    last_refusal_ = error.what();
    ROS_WARN("%s", error.what());
    return;
  }
  OfferedResult offered = from_message(result);
  offered.ask_because = why_ask(result);
  const Change offer = [&](AlignmentDecisions& d) { return d.offer(offered, now_ns()); };
  msg::StatusCode answer = apply(offer);
  if (answer.code == Code::FILE_ERROR) {
    // It is not lost: a person accepts it once the disk is mended.
    offered.ask_because = "accepted, it could not be stored: " + file_error_;
    answer = apply(offer);
  }
  const bool must_ask = policy_ == "auto" && decisions_.state().waiting_id == result.id;
  if (must_ask || (answer.code != Code::OK && answer.code != Code::NOTHING_TO_DECIDE)) {
    last_refusal_ = answer.message;
    ROS_WARN("%s", answer.message.c_str());
  } else {
    ROS_INFO("%s", answer.message.c_str());
  }
  show();
}

void TfPublisher::on_ct(CtSource source, const msg::CtInfoConstPtr& info) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string before = decisions_.state().message;
  decisions_.hold_ct(source, {info->header.frame_id, info->crc32}, now_ns());
  const std::string now = decisions_.state().message;
  if (now != before) ROS_WARN("CT with revision %u: %s", info->revision, now.c_str());
  show();
}

void TfPublisher::on_tf(const TfEvent& event, bool is_static) {
  const TfWatch::Clock::time_point now = TfWatch::Clock::now();
  for (const geometry_msgs::TransformStamped& transform : event.getConstMessage()->transforms)
    watch_.heard(transform, event.getPublisherName(), is_static, now);
}

void TfPublisher::check_tf() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const AlignmentState state = decisions_.state();
  if (!conflict(state).empty()) show();
  proposed_broadcaster_->show(proposed(state));
}

std::optional<Alignment> TfPublisher::proposed(const AlignmentState& state) const {
  std::optional<Alignment> proposed = state.proposed;
  if (!proposed || proposed_frame_.empty()) return std::nullopt;
  const bool is_taken = proposed_frame_ == proposed->ct_frame ||
                        proposed_frame_ == proposed->fixed_frame ||
                        (state.broadcast && proposed_frame_ == state.broadcast->ct_frame);
  proposed->ct_frame = proposed_frame_;
  if (is_taken ||
      !watch_.conflict(proposed->fixed_frame, proposed_frame_, TfWatch::Clock::now()).empty()) {
    ROS_WARN_THROTTLE(10.0, "what waits for accept is not shown in tf: its frame '%s' is in use",
                      proposed_frame_.c_str());
    return std::nullopt;
  }
  return proposed;
}

bool TfPublisher::decide(const Change& change, Decide::Response& response) {
  ::ros::Time last_of_other;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    response.status = apply(change);
    ROS_INFO("%s", response.status.message.c_str());
    last_of_other = show();
  }
  // The caller may rely on tf once it has the answer. Simulated time may stand still or be slow.
  const ::ros::WallTime end = ::ros::WallTime::now() + tolerance_ + tolerance_;
  while (::ros::Time::now() <= last_of_other && ::ros::WallTime::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  if (::ros::Time::now().isZero())
    response.status.message += "; nothing is broadcast before simulated time begins (/clock)";
  else if (::ros::Time::now() <= last_of_other)
    response.status.message += "; simulated time has to pass " + seconds_text(last_of_other) +
                               " before look-ups at the present time show it";
  return true;
}

::ros::Time TfPublisher::show() {
  const std::string disputed = conflict(decisions_.state());
  if (!disputed.empty()) {
    decisions_.suspend(disputed);
    ROS_ERROR("%s", decisions_.state().message.c_str());
  }
  const AlignmentState state = decisions_.state();
  const ::ros::Time last_of_other = broadcaster_->show(state.broadcast);
  proposed_broadcaster_->show(proposed(state));
  msg::Alignment message = to_message(state);
  message.policy = policy_;
  alignment_publisher_.publish(message);
  msg::Alignment waiting = to_proposed_message(state);
  waiting.policy = policy_;
  proposed_publisher_.publish(waiting);
  publish_pose(state);
  // Last, since a slow disk must not prolong a disputed broadcast.
  if (!disputed.empty()) store_suspension();
  return last_of_other;
}

void TfPublisher::store_suspension() try {
  store(decisions_.stored());
} catch (const std::exception& error) {
  file_error_ = error.what();
  ROS_ERROR("alignment_file: the suspension could not be stored: %s", file_error_.c_str());
}

void TfPublisher::publish_pose(const AlignmentState& state) {
  if (!state.broadcast) return;
  transform_publisher_.publish(to_transform_message(*state.broadcast));
  if (const auto pose = to_pose_message(*state.broadcast)) pose_publisher_.publish(*pose);
}

void TfPublisher::diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  const std::lock_guard<std::mutex> lock(mutex_);
  describe(decisions_, last_refusal_, file_error_, diagnosis);
}

}  // namespace usct::ros_interface
