#include "ros/registration_node.h"

#include <omp.h>

#include <future>

#include "ros/publisher_check.h"
#include "ros/refusal.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Status = msg::StatusCode;

/// A request that waits takes one; the others hear cancels and take volumes.
constexpr unsigned kCallbackThreads = 4;

::ros::NodeHandle with_queue(::ros::NodeHandle node, ::ros::CallbackQueue& queue) {
  node.setCallbackQueue(&queue);
  return node;
}

template <typename Message>
ExpectedTopic expected_topic(const ::ros::NodeHandle& node, const char* topic) {
  return {node.resolveName(topic), ::ros::message_traits::datatype<Message>(),
          ::ros::message_traits::md5sum<Message>()};
}

}  // namespace

RegistrationNode::RegistrationNode(const ::ros::NodeHandle& node,
                                   const ::ros::NodeHandle& private_node)
    : node_(with_queue(node, queue_)),
      parameters_(read_registration_parameters(private_node)),
      tf_(::ros::Duration(parameters_.tf_history_s)),
      tf_listener_(tf_, node),
      frame_(tf_, parameters_.frame),
      alignments_(frame_, parameters_.initial_alignment),
      volumes_(frame_, parameters_.volumes, [this] { wake(); }),
      registrar_(parameters_.registrar, volumes_, alignments_, frame_, parameters_.source),
      result_publisher_(node_.advertise<Result>("registration/result", 1, true)),
      action_(
          node_, "register_with_options", [this](auto goal) { on_goal(goal); },
          [this](auto goal) { on_cancel(goal); }, false),
      updater_(node_, private_node, private_node.getNamespace()),
      worker_([this] { work(); }),
      spinner_(kCallbackThreads, &queue_) {
  updater_.setHardwareID("none");
  updater_.add("registration", this, &RegistrationNode::diagnose);
  diagnostics_timer_ =
      node_.createWallTimer(::ros::WallDuration(parameters_.diagnostic_period_s),
                            [this](const ::ros::WallTimerEvent&) { updater_.force_update(); });
  subscribe();
  action_.start();
  spinner_.start();
}

RegistrationNode::~RegistrationNode() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
    if (running_) running_->cancelled = true;
  }
  wake_.notify_all();
  worker_.join();
  spinner_.stop();
}

void RegistrationNode::subscribe() {
  ct_subscriber_ = subscribe_ct();
  ultrasound_subscriber_ = subscribe_ultrasound();
  alignment_subscriber_ = node_.subscribe<msg::Alignment>(
      "registration/alignment", 1,
      [this](const msg::Alignment::ConstPtr& message) { alignments_.arrived(message); });
  register_service_ = node_.advertiseService("register", &RegistrationNode::on_register, this);
  set_service_ = node_.advertiseService("registration/set_initial_alignment",
                                        &RegistrationNode::on_set_initial_alignment, this);
}

::ros::Subscriber RegistrationNode::subscribe_ct() {
  return node_.subscribe<msg::CtVolume>(
      "ct/volume", 1,
      [this](const msg::CtVolume::ConstPtr& message) { volumes_.arrived(message); });
}

::ros::Subscriber RegistrationNode::subscribe_ultrasound() {
  return node_.subscribe<msg::PreScanVolume>(
      "us/volume", static_cast<std::uint32_t>(parameters_.volumes.ultrasound_volumes),
      [this](const msg::PreScanVolume::ConstPtr& message) { volumes_.arrived(message); });
}

bool RegistrationNode::reserve(const std::string& name, Result& busy) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!reserved_.empty() || stopping_) {
    busy.status.code = Status::BUSY;
    busy.status.message = stopping_ ? "the node is shutting down"
                                    : "one registration at a time; this one runs: " + reserved_;
    return false;
  }
  reserved_ = name;
  // Who asks goes before what nobody waits for.
  if (running_ && !running_->done) running_->cancelled = true;
  return true;
}

std::shared_ptr<RegistrationNode::Job> RegistrationNode::make_job(const std::string& name) const {
  auto job = std::make_shared<Job>();
  job->name = name;
  job->request.cancelled = [flag = &job->cancelled] { return flag->load(); };
  job->request.progress = [](double, const std::string&) {};
  return job;
}

void RegistrationNode::start(const std::shared_ptr<Job>& job) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    pending_ = job;
  }
  wake_.notify_all();
}

bool RegistrationNode::on_register(msg::Register::Request&, msg::Register::Response& response) {
  const std::string name = "service '" + node_.resolveName("register") + "'";
  if (reserve(name, response.result)) {
    std::promise<Result> promise;
    const auto job = make_job(name);
    job->done = [&promise](const Result& result) { promise.set_value(result); };
    start(job);
    response.result = promise.get_future().get();
  }
  response.success = response.result.status.code == Status::REGISTERED;
  response.message = response.result.status.message;
  return true;
}

bool RegistrationNode::on_set_initial_alignment(msg::SetInitialAlignment::Request& request,
                                                msg::SetInitialAlignment::Response& response) {
  const auto stopping = [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return stopping_;
  };
  try {
    response.residual = alignments_.set(
        request, ::ros::Time::now(), [&] { return volumes_.ultrasound(::ros::Time(), stopping); });
    response.status.code = Status::OK;
    response.status.message = "registrations start from it";
    if (request.type == msg::SetInitialAlignment::Request::CLEAR)
      response.status.message = "cleared";
  } catch (const Refusal& refusal) {
    response.status = refusal.status();
  }
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
  const auto job = make_job(name);
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
  start(job);
}

void RegistrationNode::on_cancel(ActionServer::GoalHandle goal) {
  const std::string id = goal.getGoalID().id;
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const std::shared_ptr<Job>& job : {pending_, running_})
    if (job && job->goal_id == id) job->cancelled = true;
}

void RegistrationNode::wake() {
  // Whoever is about to wait has the mutex until they do.
  { const std::lock_guard<std::mutex> lock(mutex_); }
  wake_.notify_all();
}

std::shared_ptr<RegistrationNode::Job> RegistrationNode::next_job() {
  if (pending_) return std::move(pending_);
  if (!parameters_.continuous || !reserved_.empty()) return nullptr;
  const HeldVolumes::Ready ready = volumes_.ready_ultrasound();
  if (ready.number == continued_) return nullptr;
  continued_ = ready.number;
  const auto job = make_job("continuous");
  job->request.us_stamp = ready.stamp;
  return job;
}

void RegistrationNode::work() {
  if (parameters_.threads > 0) omp_set_num_threads(parameters_.threads);
  std::unique_lock<std::mutex> lock(mutex_);
  // Who has the place gets an answer, even then.
  while (!stopping_ || !reserved_.empty()) {
    const std::shared_ptr<Job> job = next_job();
    if (!job) {
      wake_.wait(lock);
      continue;
    }
    running_ = job;
    if (stopping_) job->cancelled = true;
    lock.unlock();
    run(job);
    lock.lock();
  }
}

void RegistrationNode::run(const std::shared_ptr<Job>& job) {
  const bool continuous = !job->done;
  Result result = registrar_.run(job->request);
  if (!continuous) explain_nothing(*job, result);
  // Nobody asked for it, and somebody asked for another: no result.
  const bool is_nothing = continuous && result.status.code == Status::CANCELLED;
  if (!is_nothing) publish(result, continuous);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    running_.reset();
    if (!continuous) reserved_.clear();
  }
  if (!continuous) job->done(result);
}

void RegistrationNode::explain_nothing(Job& job, Result& result) {
  if (result.status.code == Status::NO_CT)
    result.status.message +=
        ": " + why_nothing_arrived(
                   node_, expected_topic<msg::CtVolume>(node_, "ct/volume"), ct_subscriber_,
                   [this] { return subscribe_ct(); }, job.request.cancelled);
  if (result.status.code == Status::NO_ULTRASOUND && volumes_.state().ultrasound_volumes == 0)
    result.status.message +=
        ": " + why_nothing_arrived(
                   node_, expected_topic<msg::PreScanVolume>(node_, "us/volume"),
                   ultrasound_subscriber_, [this] { return subscribe_ultrasound(); },
                   job.request.cancelled);
}

void RegistrationNode::publish(Result& result, bool continuous) {
  result.id = ++last_id_;
  statistics_.count(result, continuous, ::ros::Time::now());
  result_publisher_.publish(result);
}

void RegistrationNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  std::string running;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (running_) running = running_->name;
  }
  statistics_.describe(volumes_.state(), running, ::ros::Time::now(), status);
}

}  // namespace usct::ros_interface
