#include "ros/registration/registration_node.h"

#include <algorithm>
#include <future>
#include <memory>
#include <optional>

#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "ros/node/refusal.h"
#include "ros/node/status.h"
#include "ros/registration/publisher_check.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Status = msg::StatusCode;

/// A service call that waits for its registration blocks one thread; the others receive cancels and
/// volumes.
constexpr unsigned kCallbackThreads = 4;

/// Simulated time may jump back, and begins anew with each bag.
template <typename Message>
ExpectedTopic expected_topic(const ::ros::NodeHandle& node, const char* topic) {
  return {node.resolveName(topic), ::ros::message_traits::datatype<Message>(),
          ::ros::message_traits::md5sum<Message>()};
}

}  // namespace

RegistrationNode::RegistrationNode(const ::ros::NodeHandle& node,
                                   const ::ros::NodeHandle& private_node)
    : node_(with_queue(node, guarded_)),
      parameters_(read_registration_parameters(private_node)),
      tf_(::ros::Duration(parameters_.tf_history_s), parameters_.max_tf_gap_s),
      tf_input_(tf_, node),
      frame_(tf_, parameters_.frame),
      alignments_(frame_, parameters_.initial_alignment),
      decisions_(DecisionWatch::Clock::now()),
      ct_publisher_(node_.advertise<msg::CtInfo>("registration/ct", 1, true)),
      volumes_(frame_, parameters_.volumes,
               [this] {
                 announce_ct();
                 jobs_.wake();
               }),
      registrar_(parameters_.registrar, volumes_, alignments_, frame_, parameters_.source),
      result_publisher_(node_.advertise<Result>("registration/result", 1, true)),
      action_(
          node_, "register_with_options", [this](auto goal) { on_goal(goal); },
          [this](auto goal) { on_cancel(goal); }, false),
      updater_(node_, private_node, private_node.getNamespace()),
      worker_(jobs_, work()),
      spinner_(kCallbackThreads, &queue_) {
  updater_.setHardwareID("none");
  updater_.add("registration", this, &RegistrationNode::diagnose);
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(parameters_.diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { updater_.force_update(); }));
  subscribe();
  action_.start();
  spinner_.start();
}

RegistrationNode::~RegistrationNode() {
  // The spinner is destroyed first and waits for its callbacks. A callback may be waiting for a
  // registration, which must therefore be cancelled before.
  jobs_.stop();
}

RegistrationWorker::Work RegistrationNode::work() {
  RegistrationWorker::Work wired;
  wired.threads = parameters_.threads;
  if (parameters_.continuous) wired.newest = [this] { return volumes_.ready_ultrasound(); };
  wired.was_registered = [this](const ::ros::Time& us_stamp) {
    const std::optional<CtIdentity> ct = volumes_.newest_ct();
    return ct && alignments_.is_in_force(us_stamp, *ct);
  };
  wired.is_decision_awaited = [this] { return decisions_.is_awaited(DecisionWatch::Clock::now()); };
  wired.is_ct_unprepared = [this] { return registrar_.is_ct_unprepared(); };
  wired.prepare_ct = [this](RegistrationJob& job) { registrar_.prepare_ct(job.request.cancelled); };
  wired.run = [this](RegistrationJob& job) { return run(job); };
  return wired;
}

void RegistrationNode::subscribe() {
  ct_announcement_subscriber_ = node_.subscribe<msg::CtInfo>(
      "ct/info", 1, [this](const msg::CtInfo::ConstPtr& info) { volumes_.announced(*info); });
  ct_subscriber_ = subscribe_ct();
  ultrasound_subscriber_ = subscribe_ultrasound();
  announcement_subscriber_ = node_.subscribe<msg::Acquisition>(
      "us/announced", 1, [this](const msg::Acquisition::ConstPtr& acquisition) {
        volumes_.announced(*acquisition, ::ros::Time::now());
      });
  alignment_subscriber_ = node_.subscribe<msg::Alignment>(
      "registration/alignment", 1,
      [this](const msg::Alignment::ConstPtr& message) { on_alignment(message); });
  register_service_ = node_.advertiseService("register", &RegistrationNode::on_register, this);
  set_service_ = node_.advertiseService("registration/set_initial_alignment",
                                        &RegistrationNode::on_set_initial_alignment, this);
  cancel_service_ =
      node_.advertiseService("registration/cancel", &RegistrationNode::on_cancel_request, this);
}

::ros::Subscriber RegistrationNode::subscribe_ct() {
  return node_.subscribe<msg::CtVolume>("ct/volume", 1,
                                        [this](const msg::CtVolume::ConstPtr& message) {
                                          volumes_.arrived(message, ::ros::Time::now());
                                        });
}

::ros::Subscriber RegistrationNode::subscribe_ultrasound() {
  return node_.subscribe<msg::PreScanVolume>(
      "us/volume", static_cast<std::uint32_t>(parameters_.volumes.ultrasound_volumes),
      [this](const msg::PreScanVolume::ConstPtr& message) {
        volumes_.arrived(message, ::ros::Time::now());
      });
}

void RegistrationNode::on_alignment(const msg::Alignment::ConstPtr& message) {
  alignments_.arrived(message);
  decisions_.arrived(*message);
  // Continuous registrations go on once a decision is taken.
  jobs_.wake();
}

bool RegistrationNode::reserve(const std::string& name, Result& busy) {
  const std::optional<std::string> reason = jobs_.reserve(name);
  if (reason) busy.status = status(Status::BUSY, *reason);
  return !reason;
}

bool RegistrationNode::on_register(msg::Register::Request&, msg::Register::Response& response) {
  const std::string name = "service '" + node_.resolveName("register") + "'";
  if (reserve(name, response.result)) {
    std::promise<Result> promise;
    const auto job = std::make_shared<RegistrationJob>(name);
    job->done = [&promise](const Result& result) { promise.set_value(result); };
    jobs_.put(job);
    response.result = promise.get_future().get();
  }
  response.success = response.result.status.code == Status::REGISTERED;
  response.message = response.result.status.message;
  return true;
}

bool RegistrationNode::on_set_initial_alignment(msg::SetInitialAlignment::Request& request,
                                                msg::SetInitialAlignment::Response& response) {
  const auto stopping = [this] { return jobs_.is_stopping(); };
  try {
    response.residual = alignments_.set(request, volumes_.newest_ct(), [&] {
      return volumes_.ultrasound(::ros::Time(), stopping);
    });
    const bool is_cleared = request.type == msg::SetInitialAlignment::Request::CLEAR;
    response.status = status(Status::OK, is_cleared ? "cleared" : "registrations start from it");
  } catch (const Refusal& refusal) {
    response.status = refusal.status();
  } catch (const std::exception& error) {
    response.status = status(Status::FAILED, error.what());
  }
  return true;
}

bool RegistrationNode::on_cancel_request(msg::Cancel::Request&, msg::Cancel::Response& response) {
  const std::optional<std::string> cancelled = jobs_.cancel_request();
  response.status = cancelled ? status(Status::OK, *cancelled + " is cancelled")
                              : status(Status::NOT_RUNNING, "no requested registration is running");
  return true;
}

void RegistrationNode::on_goal(ActionServer::GoalHandle goal) {
  const std::string name = "goal of '" + node_.resolveName("register_with_options") + "'";
  msg::RegisterResult answer;
  if (!reserve(name, answer.result)) {
    goal.setRejected(answer, answer.result.status.message);
    return;
  }
  goal.setAccepted();
  const auto job = std::make_shared<RegistrationJob>(name);
  job->goal_id = goal.getGoalID().id;
  job->request.preset = goal.getGoal()->preset;
  job->request.options = goal.getGoal()->options;
  if (goal.getGoal()->use_initial) job->request.initial = goal.getGoal()->initial;
  job->request.us_stamp = goal.getGoal()->us_stamp;
  job->request.progress = [goal](double fraction, const std::string& stage) mutable {
    msg::RegisterFeedback feedback;
    feedback.progress = static_cast<float>(fraction);
    feedback.stage = stage;
    goal.publishFeedback(feedback);
  };
  job->done = [goal](const Result& result) mutable {
    msg::RegisterResult ended;
    ended.result = result;
    if (result.status.code == Status::REGISTERED)
      goal.setSucceeded(ended, result.status.message);
    else if (result.status.code == Status::CANCELLED)
      goal.setCanceled(ended, result.status.message);
    else
      goal.setAborted(ended, result.status.message);
  };
  jobs_.put(job);
  // A cancel may have come before the job could be found.
  if (goal.getGoalStatus().status == actionlib_msgs::GoalStatus::PREEMPTING)
    jobs_.cancel(job->goal_id);
}

void RegistrationNode::on_cancel(ActionServer::GoalHandle goal) {
  jobs_.cancel(goal.getGoalID().id);
}

RegistrationNode::Result RegistrationNode::run(RegistrationJob& job) {
  Result result = registrar_.run(job.request);
  try {
    finish(job, result);
  } catch (const std::exception& error) {
    log_escaped("a registration", error);
    result = Result();
    result.status = status(Status::FAILED, error.what());
  }
  return result;
}

void RegistrationNode::finish(const RegistrationJob& job, Result& result) {
  if (!job.is_background()) explain_nothing(job, result);
  // A request cancels a continuous registration, for whose result no caller waits.
  if (!job.is_background() || result.status.code != Status::CANCELLED)
    publish(result, job.is_background());
}

void RegistrationNode::explain_nothing(const RegistrationJob& job, Result& result) {
  if (result.status.code == Status::NO_CT && !volumes_.state().ct)
    result.status.message +=
        ": " + why_nothing_arrived(
                   node_, expected_topic<msg::CtVolume>(node_, "ct/volume"), ct_subscriber_,
                   [this] { return subscribe_ct(); }, job.request.cancelled);
  if (result.status.message == kNothingReceived)
    result.status.message +=
        ": " + why_nothing_arrived(
                   node_, expected_topic<msg::PreScanVolume>(node_, "us/volume"),
                   ultrasound_subscriber_, [this] { return subscribe_ultrasound(); },
                   job.request.cancelled);
}

void RegistrationNode::publish(Result& result, bool continuous) {
  // The clock may have been set back.
  result.id = last_id_ = std::max(last_id_ + 1, wall_time_ms());
  if (result.status.code == Status::REGISTERED) {
    result.status.message += next_step(result);
    decisions_.offered(DecisionWatch::Clock::now());
  }
  statistics_.count(result, continuous, ::ros::Time::now());
  ROS_INFO("result %lu, %s, ultrasound of %s s, CT revision %u, start %s, %.2f s: %s", result.id,
           code_name(result.status.code).c_str(), seconds_text(result.us_stamp).c_str(),
           result.ct_revision,
           result.initial_alignment.empty() ? "none" : result.initial_alignment.c_str(),
           result.durations.back().value, result.status.message.c_str());
  result_publisher_.publish(result);
}

std::string RegistrationNode::next_step(const Result& result) const {
  const std::string policy = alignments_.policy();
  const std::string accept = node_.resolveName("registration/accept");
  if (policy.empty())
    return "; it is not broadcast, for no tf_publisher was heard on '" +
           node_.resolveName("registration/alignment") + "'";
  if (policy == "auto")
    return "; tf_publisher decides by itself: see " + node_.resolveName("registration/alignment");
  return "; it waits until a person accepts it: rosservice call " + accept + " " +
         std::to_string(result.id);
}

void RegistrationNode::announce_ct() {
  const std::shared_ptr<const HeldCt> ct = volumes_.state().ct;
  // A ct_server that was started again counts its revisions anew, and may have another `ct_frame`.
  if (!ct || (announced_ct_.revision == ct->revision && announced_ct_.crc32 == ct->crc32 &&
              announced_ct_.header.frame_id == ct->header.frame_id))
    return;
  announced_ct_.header = ct->header;
  announced_ct_.revision = ct->revision;
  announced_ct_.crc32 = ct->crc32;
  ct_publisher_.publish(announced_ct_);
}

void RegistrationNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  volumes_.notice_time(::ros::Time::now());
  statistics_.describe(volumes_.state(), jobs_.running(), ::ros::Time::now(), diagnosis);
}

}  // namespace usct::ros_interface
