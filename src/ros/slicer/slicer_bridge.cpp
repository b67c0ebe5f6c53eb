#include "ros/slicer/slicer_bridge.h"

#include <tf2/exceptions.h>
#include <us_ct_registration/Cancel.h>
#include <us_ct_registration/Decide.h>
#include <us_ct_registration/Register.h>
#include <us_ct_registration/SetInitialAlignment.h>

#include <sstream>

#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "ros/node/parameters.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

const std::string kTransform = "ct_to_us";
const std::string kAcquiredTransform = "ct_to_us_acquired";
const std::string kStatus = "registration_status";
const std::string kSubject = "registration";
const std::string kAnswer = "answer";
const std::string kCommand = "command";
const std::string kCtLandmarks = "ct_landmarks";
const std::string kUsLandmarks = "us_landmarks";

/// A registration that searches all orientations may take a minute.
constexpr ServiceCalls::Seconds kCallLimit(120.0);

}  // namespace

SlicerBridge::SlicerBridge(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node),
      tf_input_(tf_, node_),
      diagnostics_(node, private_node, private_node.getNamespace()) {
  Parameters parameters(private_node);
  IgtlServerOptions options;
  options.address = parameters.text("address", options.address);
  options.port = parameters.whole("port", options.port, 0, 65535);
  us_frame_ = parameters.frame("us_frame", "us");
  max_tf_age_s_ = parameters.number("max_tf_age", 1.0, 0.0, 3600.0);
  const double rate_hz = parameters.number("rate", 10.0, 0.1, 100.0);
  const double diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  diagnostics_.setHardwareID("none");
  diagnostics_.add("OpenIGTLink", this, &SlicerBridge::diagnose);
  serve(options);
  subscribe();
  timer_ = node_.createWallTimer(::ros::WallDuration(1.0 / rate_hz),
                                 guarded([this](const ::ros::WallTimerEvent&) {
                                   const std::lock_guard<std::mutex> lock(mutex_);
                                   tick();
                                 }));
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); }));
}

void SlicerBridge::serve(const IgtlServerOptions& options) {
  IgtlServer::Callbacks callbacks;
  callbacks.greeting = [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return words_of(news());
  };
  callbacks.message = [this](const IgtlHeader& header, const std::string& content) {
    const std::lock_guard<std::mutex> lock(mutex_);
    take_message(header, content);
  };
  callbacks.log = [this](const std::string& line) {
    ROS_INFO("%s", line.c_str());
    const std::lock_guard<std::mutex> lock(mutex_);
    last_event_ = line;
  };
  // A client may come before the constructor has returned; its messages wait for the lock.
  const std::lock_guard<std::mutex> lock(mutex_);
  server_ = std::make_unique<IgtlServer>(options, std::move(callbacks));
  ROS_INFO("OpenIGTLink at %s:%d", options.address.c_str(), server_->port());
}

template <class Message>
::ros::Subscriber SlicerBridge::follow(const std::string& topic,
                                       void (OperatorState::*take)(const Message&)) {
  return node_.subscribe<Message>(topic, 10,
                                  [this, take](const typename Message::ConstPtr& message) {
                                    const std::lock_guard<std::mutex> lock(mutex_);
                                    (state_.*take)(*message);
                                    tick();
                                  });
}

void SlicerBridge::subscribe() {
  alignment_ = follow("registration/alignment", &OperatorState::take_alignment);
  proposed_ = follow("registration/proposed", &OperatorState::take_proposed);
  result_ = follow("registration/result", &OperatorState::take_result);
  ct_ = node_.subscribe<msg::CtInfo>(
      "registration/ct", 1, [this](const msg::CtInfoConstPtr& message) {
        const std::lock_guard<std::mutex> lock(mutex_);
        // Landmarks of another CT must not be used for this one.
        auto ct = std::make_pair(message->header.frame_id, message->crc32);
        if (ct != held_ct_) landmarks_.clear();
        held_ct_ = std::move(ct);
      });
}

std::optional<Eigen::Isometry3d> SlicerBridge::look_up(std::string& why_not) const {
  const msg::Alignment& alignment = state_.alignment();
  if (!state_.is_in_force()) {
    why_not = state_.in_force();
    return std::nullopt;
  }
  try {
    const geometry_msgs::TransformStamped found =
        tf_.look_up(us_frame_, alignment.ct_frame, ::ros::Time());
    const double age_s = seconds_between(found.header.stamp, ::ros::Time::now());
    if (age_s <= max_tf_age_s_) {
      // After a switch, the newest transform is for a moment that of the alignment before.
      if (state_.aligned()) T_fixed_ct_in_tf(tf_, *state_.aligned(), found.header.stamp);
      return from_message_mm(found.transform, "tf");
    }
    why_not = formatted(
        "the newest transform from '%s' to '%s' is %.1f s old, must be at most "
        "max_tf_age = %.1f s",
        alignment.ct_frame.c_str(), us_frame_.c_str(), age_s, max_tf_age_s_);
  } catch (const tf2::TransformException& error) {
    why_not = std::string("tf has no transform: ") + error.what();
  } catch (const std::exception& error) {  // InputError or Refusal
    why_not = error.what();
  }
  return std::nullopt;
}

std::optional<Eigen::Isometry3d> SlicerBridge::as_acquired() const try {
  const msg::RegistrationResult* result = state_.result_in_force();
  if (result == nullptr) return std::nullopt;
  return from_message_mm(result->transform, "result");
} catch (const InputError&) {  // another program's result, without this transform
  return std::nullopt;
}

SlicerBridge::News SlicerBridge::news() const {
  News news;
  std::string why_not;
  news.T_us_ct = look_up(why_not);
  if (news.T_us_ct) news.T_us_ct_acquired = as_acquired();
  const bool is_restored = state_.alignment().state == msg::Alignment::RESTORED;
  news.status = news.T_us_ct ? state_.in_force() +
                                   (is_restored ? ", RESTORED: the patient may have moved" : "")
                             : "NO TRANSFORM is sent: " + why_not;
  const OperatorSubject subject = state_.subject();
  news.subject = subject.headline + "\n" + subject.evidence;
  return news;
}

std::string SlicerBridge::words_of(const News& news) const {
  return igtl_status(kStatus, news.T_us_ct.has_value(), news.status) +
         igtl_string(kSubject, news.subject);
}

void SlicerBridge::tick() {
  calls_.poll();
  state_.look_up(tf_, ::ros::Time::now(), AlignmentWatch::Clock::now());
  const News now = news();
  if (now.T_us_ct) server_->send(igtl_transform(kTransform, *now.T_us_ct));
  if (now.T_us_ct_acquired)
    server_->send(igtl_transform(kAcquiredTransform, *now.T_us_ct_acquired));
  const std::string words = now.status + "\n" + now.subject;
  const ::ros::WallTime time = ::ros::WallTime::now();
  constexpr double kPeriodS = 1.0;
  if (words == sent_words_ && (time - words_sent_at_).toSec() < kPeriodS) return;
  server_->send(words_of(now));
  sent_words_ = words;
  words_sent_at_ = time;
}

void SlicerBridge::answer(const std::string& words) {
  last_event_ = words;
  server_->send(igtl_string(kAnswer, words));
}

void SlicerBridge::take_message(const IgtlHeader& header, const std::string& content) {
  const std::string source = header.type + " '" + header.device + "'";
  if (header.type == "POINT")
    take_landmarks(header.device, igtl_points_lps_mm(content, source));
  else if (header.type == "STRING" && header.device == kCommand)
    obey(igtl_text(content, source));
  // Other messages are for other programs: Slicer sends what its user has chosen.
}

void SlicerBridge::take_landmarks(const std::string& name,
                                  const std::vector<Eigen::Vector3d>& points_lps_mm) {
  if (name != kCtLandmarks && name != kUsLandmarks)
    return answer("the points '" + name + "' are not used: landmarks are '" + kCtLandmarks +
                  "' and '" + kUsLandmarks + "'");
  landmarks_[name] = points_lps_mm;
  const std::vector<Eigen::Vector3d>& ct = landmarks_[kCtLandmarks];
  const std::vector<Eigen::Vector3d>& us = landmarks_[kUsLandmarks];
  constexpr std::size_t kLeast = 3;
  if (ct.size() != us.size() || ct.size() < kLeast)
    return answer(std::to_string(ct.size()) + " landmarks of the CT and " +
                  std::to_string(us.size()) +
                  " of the ultrasound: nothing is set until there are equally many, at least 3");
  msg::SetInitialAlignment::Request request;
  request.type = msg::SetInitialAlignment::Request::LANDMARKS;
  request.header.frame_id = us_frame_;
  for (std::size_t i = 0; i < ct.size(); ++i) {
    request.points_ct.push_back(to_message(ct[i]));
    request.points.push_back(to_message(us[i]));
  }
  call<msg::SetInitialAlignment>("registration/set_initial_alignment", request,
                                 [](const msg::SetInitialAlignment::Response& response) {
                                   if (response.status.code != msg::StatusCode::OK)
                                     return response.status.message;
                                   return response.status.message +
                                          formatted("; the landmarks agree to %.1f mm",
                                                    kMmPerM * response.residual);
                                 });
}

void SlicerBridge::obey(const std::string& command) {
  std::istringstream words(command);
  std::string verb;
  std::string id;
  std::string rest;
  words >> verb >> id >> rest;
  const auto message_of = [](const auto& response) { return response.status.message; };
  const bool is_decision = verb == "accept" || verb == "reject";
  const bool is_number =
      !id.empty() && id.size() <= 19 && id.find_first_not_of("0123456789") == std::string::npos;
  if (is_decision && is_number && rest.empty() && std::stoull(id) > 0) {
    msg::Decide::Request request;
    request.result_id = std::stoull(id);
    return call<msg::Decide>("registration/" + verb, request, message_of);
  }
  if (is_decision)
    return answer("'" + verb + "' needs the number of the result that was looked at, such as '" +
                  verb + " 1795384193175'");
  if (id.empty()) {
    if (verb == "revert") return call<msg::Decide>("registration/revert", {}, message_of);
    if (verb == "cancel") return call<msg::Cancel>("registration/cancel", {}, message_of);
    if (verb == "register")
      return call<msg::Register>(
          "register", {}, [](const msg::Register::Response& response) { return response.message; });
  }
  answer("the command must be 'accept NUMBER', 'reject NUMBER', 'revert', 'register' or 'cancel'");
}

template <class Service, class Words>
void SlicerBridge::call(const std::string& name, const typename Service::Request& request,
                        Words words) {
  constexpr std::size_t kMostCalls = 8;
  if (calls_.running() >= kMostCalls)
    return answer(name + ": not called, because " + std::to_string(kMostCalls) +
                  " calls wait for their answers");
  calls_.start<Service>(
      node_.resolveName(name), request, kCallLimit,
      [this, name, words](const typename Service::Response* response, const std::string& problem) {
        answer(name + ": " + (response != nullptr ? words(*response) : problem));
      });
}

void SlicerBridge::diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  using diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard<std::mutex> lock(mutex_);
  const News now = news();
  const bool is_missing = state_.is_announced() && !now.T_us_ct;
  diagnosis.summary(is_missing ? DiagnosticStatus::WARN : DiagnosticStatus::OK, now.status);
  diagnosis.add("port", server_->port());
  diagnosis.add("clients", server_->clients());
  diagnosis.add("last event", last_event_);
}

}  // namespace usct::ros_interface
