#include "ros/tf_publisher.h"

#include <algorithm>

#include "ros/conversions/alignment.h"
#include "ros/conversions/times.h"
#include "ros/parameters.h"
#include "ros/status.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/results/alignment_file.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;

const char* name_of(const AlignmentState& state) {
  if (!state.broadcast) return "none";
  return state.broadcast->restored ? "restored" : "accepted";
}

std::int64_t now_ns() { return nanoseconds_from(::ros::Time::now()); }

}  // namespace

TfPublisher::TfPublisher(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node), diagnostics_(node, private_node, private_node.getNamespace()) {
  Parameters parameters(private_node);
  AlignmentDecisions::Options options;
  options.fixed_frame = parameters.frame("fixed_frame", "");
  options.accept_at_once = parameters.choice("policy", "confirm", {"auto", "confirm"}) == "auto";
  options.restore_at_once =
      parameters.choice("restore", "same_ct", {"same_ct", "confirm"}) == "same_ct";
  alignment_file_ = parameters.text("alignment_file", "");
  const double rate_hz = parameters.number("rate", 20.0, 1.0, 1000.0);
  const double tolerance_s = parameters.number("transform_tolerance", 0.2, 0.0, 10.0);
  const double diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  if (tolerance_s * rate_hz < 1.0)
    throw InputError(private_node.resolveName("transform_tolerance"),
                     "is " + std::to_string(tolerance_s) + " s, must be >= 1 / rate = " +
                         std::to_string(1.0 / rate_hz) + " s, or look-ups fail between broadcasts");
  transform_tolerance_ = ::ros::Duration(tolerance_s);
  decisions_ = AlignmentDecisions(options);
  restore();

  alignment_publisher_ = node_.advertise<msg::Alignment>("registration/alignment", 1, true);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("alignment", this, &TfPublisher::diagnose);
  publish_alignment();
  accept_server_ = node_.advertiseService<Decide::Request, Decide::Response>(
      "registration/accept", [this](Decide::Request& request, Decide::Response& response) {
        return decide([&](AlignmentDecisions& d) { return d.accept(request.result_id, now_ns()); },
                      response);
      });
  reject_server_ = node_.advertiseService<Decide::Request, Decide::Response>(
      "registration/reject", [this](Decide::Request& request, Decide::Response& response) {
        return decide([&](AlignmentDecisions& d) { return d.reject(request.result_id); }, response);
      });
  revert_server_ = node_.advertiseService<Decide::Request, Decide::Response>(
      "registration/revert", [this](Decide::Request&, Decide::Response& response) {
        return decide([](AlignmentDecisions& d) { return d.revert(); }, response);
      });
  ct_subscriber_ = node_.subscribe("ct/info", 1, &TfPublisher::on_ct, this);
  result_subscriber_ = node_.subscribe("registration/result", 10, &TfPublisher::on_result, this);
  broadcast_timer_ = node_.createTimer(::ros::Duration(1.0 / rate_hz),
                                       [this](const ::ros::TimerEvent&) { broadcast(); });
  // The timer above follows simulated time, which stands still once a bag has ended. Late
  // subscribers must get the transform as well.
  still_clock_timer_ = node_.createWallTimer(::ros::WallDuration(1.0),
                                             [this](const ::ros::WallTimerEvent&) { broadcast(); });
  diagnostics_timer_ =
      node_.createWallTimer(::ros::WallDuration(diagnostic_period_s),
                            [this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); });
}

void TfPublisher::restore() {
  if (alignment_file_.empty()) return;
  try {
    const DecisionAnswer answer = decisions_.restore(read_alignment(alignment_file_));
    if (answer.is_done()) return;
    file_error_ = answer.message;
  } catch (const std::exception& error) {
    file_error_ = error.what();
  }
  // The node starts nevertheless, because otherwise no new result could be accepted either.
  ROS_ERROR("alignment_file: %s", file_error_.c_str());
}

void TfPublisher::store(const StoredAlignment& changed) {
  if (alignment_file_.empty() || changed == decisions_.stored()) return;
  write_alignment(changed, alignment_file_);
  file_error_.clear();
}

msg::StatusCode TfPublisher::apply(const Change& change) {
  AlignmentDecisions changed = decisions_;
  const DecisionAnswer answer = change(changed);
  if (!answer.is_done()) return to_message(answer);
  try {
    store(changed.stored());
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
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const OfferedResult offered = from_message(*result);
    const msg::StatusCode answer =
        apply([&](AlignmentDecisions& d) { return d.offer(offered, now_ns()); });
    if (answer.code != Code::OK && answer.code != Code::NOTHING_TO_DECIDE) {
      last_refusal_ = answer.message;
      ROS_WARN("%s", answer.message.c_str());
    } else {
      ROS_INFO("%s", answer.message.c_str());
    }
    publish_alignment();
  }
  broadcast();
}

void TfPublisher::on_ct(const msg::CtInfoConstPtr& info) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string before = decisions_.state().message;
    decisions_.hold_ct(info->crc32);
    const std::string now = decisions_.state().message;
    if (now != before) ROS_WARN("CT with revision %u: %s", info->revision, now.c_str());
    publish_alignment();
  }
  broadcast();
}

bool TfPublisher::decide(const Change& change, Decide::Response& response) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    response.status = apply(change);
    ROS_INFO("%s", response.status.message.c_str());
    publish_alignment();
  }
  broadcast();
  return true;
}

void TfPublisher::publish_alignment() {
  alignment_publisher_.publish(to_message(decisions_.state()));
}

void TfPublisher::broadcast() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ::ros::Time now = ::ros::Time::now();
  if (now.isZero()) return;  // simulated time has not begun
  if (now < last_now_) {
    ROS_WARN("time jumped back by %.3f s", (last_now_ - now).toSec());
    last_stamp_ = ::ros::Time();
  }
  last_now_ = now;
  const std::optional<Alignment> alignment = decisions_.state().broadcast;
  if (!alignment) return;
  geometry_msgs::TransformStamped transform;
  // tf drops a second transform with the same stamp, so that a new alignment would be lost while
  // simulated time stands still.
  const ::ros::Time next(last_stamp_.sec, last_stamp_.nsec + 1);
  transform.header.stamp = last_stamp_ = std::max(now + transform_tolerance_, next);
  transform.header.frame_id = alignment->fixed_frame;
  transform.child_frame_id = alignment->ct_frame;
  transform.transform = to_message(alignment->T_fixed_ct);
  broadcaster_.sendTransform(transform);
}

void TfPublisher::diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  using diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard<std::mutex> lock(mutex_);
  const AlignmentState state = decisions_.state();
  const Alignment alignment = state.broadcast.value_or(Alignment());
  const bool is_held_back = !state.broadcast && decisions_.stored().alignment;
  const bool is_attention =
      alignment.restored || is_held_back || state.waiting_id != 0 || !last_refusal_.empty();
  if (!file_error_.empty())
    diagnosis.summary(DiagnosticStatus::ERROR, "alignment_file: " + file_error_);
  else
    diagnosis.summary(is_attention ? DiagnosticStatus::WARN : DiagnosticStatus::OK, state.message);
  diagnosis.add("state", name_of(state));
  diagnosis.add("fixed frame", alignment.fixed_frame);
  diagnosis.add("CT frame", alignment.ct_frame);
  if (state.broadcast) {
    const ::ros::Time now = ::ros::Time::now();
    diagnosis.add("age of the ultrasound (s)",
                  seconds_between(time_from(alignment.us_stamp_ns), now));
    diagnosis.add("accepted since (s)", seconds_between(time_from(alignment.accepted_ns), now));
    diagnosis.add("expected error (mm)", 1000.0 * alignment.expected_error_m);
  }
  diagnosis.add("result", alignment.result_id);
  diagnosis.add("waiting result", state.waiting_id);
  diagnosis.add("alignments to go back to", decisions_.history());
  diagnosis.add("last refusal", last_refusal_);
}

}  // namespace usct::ros_interface
