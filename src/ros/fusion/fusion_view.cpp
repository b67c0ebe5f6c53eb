#include "ros/fusion/fusion_view.h"

#include <sensor_msgs/Image.h>

#include <chrono>

#include "ros/conversions/ct.h"
#include "ros/conversions/images.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "ros/node/refusal.h"
#include "ros/node/status.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;

/// The pictures of a view and their topics.
struct Output {
  const char* topic;
  Picture FusionView::*picture;
};
constexpr std::array<Output, 4> kOutputs = {{{"fusion/elevation", &FusionView::elevation},
                                             {"fusion/lateral", &FusionView::lateral},
                                             {"fusion/axial", &FusionView::axial},
                                             {"fusion/sheet", &FusionView::sheet}}};

}  // namespace

FusionViewNode::FusionViewNode(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node), diagnostics_(node, private_node, private_node.getNamespace()) {
  Parameters parameters(private_node);
  read_parameters(parameters, private_node);
  const double diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  keeper_ = std::make_unique<FusionSceneKeeper>(scene_options_);
  placer_ =
      std::make_unique<UltrasoundPlacer>(tf_, UltrasoundPlacerOptions{fixed_frame_, tf_timeout_s_});
  tf_input_ = std::make_unique<TfInput>(tf_, node_);
  advertise();
  subscribe();
  diagnostics_.setHardwareID("none");
  diagnostics_.add("view", this, &FusionViewNode::diagnose);
  tf_timer_ = node_.createWallTimer(::ros::WallDuration(AlignmentWatch::kPeriod_s),
                                    guarded([this](const ::ros::WallTimerEvent&) { follow_tf(); }));
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); }));
  thread_ = std::thread([this] { run(); });
}

FusionViewNode::~FusionViewNode() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void FusionViewNode::read_parameters(Parameters& parameters,
                                     const ::ros::NodeHandle& private_node) {
  fixed_frame_ = parameters.frame("fixed_frame", "");
  scene_options_.mode =
      *fusion_mode_named(parameters.choice("mode", "contours", fusion_mode_names()));
  pixel_mm_ = kMmPerM * parameters.number("pixel_size", 0.0004, 0.00005, 0.005);
  if (const std::vector<double> centre_m = parameters.numbers("centre", 3); !centre_m.empty())
    scene_options_.centre_us_mm = kMmPerM * Eigen::Vector3d(centre_m.data());
  scene_options_.centre_label = parameters.text("centre_label", "kidney");
  scene_options_.accept_service = node_.resolveName("registration/accept");
  scene_options_.reject_service = node_.resolveName("registration/reject");
  tf_timeout_s_ = parameters.number("tf_timeout", 1.0, 0.0, 60.0);
  if (const std::string root = parameters.text("save_root", ""); !root.empty())
    save_root_.emplace(root, private_node.resolveName("save_root"));
}

void FusionViewNode::advertise() {
  for (std::size_t i = 0; i < kOutputs.size(); ++i)
    publishers_[i] = node_.advertise<sensor_msgs::Image>(
        kOutputs[i].topic, 1, [this, i](const ::ros::SingleSubscriberPublisher& subscriber) {
          show(subscriber, kOutputs[i].picture);
        });
  mode_server_ = node_.advertiseService("fusion/set_mode", &FusionViewNode::set_mode, this);
  save_server_ = node_.advertiseService("fusion/save", &FusionViewNode::save, this);
}

void FusionViewNode::subscribe() {
  const auto to_keeper = [this](const char* topic, auto type, auto taker) {
    using Message = decltype(type);
    subscribers_.push_back(node_.subscribe<Message>(
        topic, 5, [this, taker](const boost::shared_ptr<const Message>& message) {
          try {
            update([&](FusionSceneKeeper& keeper) { (keeper.*taker)(*message); });
          } catch (const InputError& error) {
            ROS_ERROR("%s", error.what());
          }
        }));
  };
  to_keeper("registration/alignment", msg::Alignment(), &FusionSceneKeeper::take_alignment);
  to_keeper("registration/proposed", msg::Alignment(), &FusionSceneKeeper::take_proposed);
  to_keeper("registration/result", msg::RegistrationResult(), &FusionSceneKeeper::take_result);
  to_keeper("ct/surface", visualization_msgs::MarkerArray(), &FusionSceneKeeper::take_surface);
  subscribers_.push_back(node_.subscribe("us/volume", 1, &FusionViewNode::take_ultrasound, this));
  subscribers_.push_back(node_.subscribe("ct/volume", 1, &FusionViewNode::take_ct, this));
  subscribers_.push_back(node_.subscribe("fusion/centre", 1, &FusionViewNode::take_centre, this));
}

template <typename Change>
void FusionViewNode::update(const Change& change) {
  {
    const std::lock_guard lock(mutex_);
    change(*keeper_);
    ++state_;
  }
  changed_.notify_all();
}

void FusionViewNode::take_ultrasound(const msg::PreScanVolumeConstPtr& message) try {
  require_stamped(message->header.stamp, ::ros::Time::now(), "us/volume");
  const std::lock_guard placing(placing_);
  const std::shared_ptr<const FusionUltrasound> us = placer_->take(*message);
  update([&](FusionSceneKeeper& keeper) {
    keeper.take(us);
    ultrasound_problem_.clear();
  });
} catch (const std::exception& error) {
  ROS_ERROR("%s", error.what());
  const std::lock_guard lock(mutex_);
  ultrasound_problem_ =
      "ultrasound of " + seconds_text(message->header.stamp) + " s is not shown: " + error.what();
}

void FusionViewNode::follow_tf() {
  {
    const std::lock_guard lock(mutex_);
    if (keeper_->look_up(tf_, ::ros::Time::now(), AlignmentWatch::Clock::now())) {
      ++state_;
      changed_.notify_all();
    }
  }
  const std::unique_lock placing(placing_, std::try_to_lock);
  if (!placing) return;  // newer ultrasound is on its way
  if (const std::shared_ptr<const FusionUltrasound> us = placer_->place_again())
    update([&](FusionSceneKeeper& keeper) { keeper.take(us); });
}

void FusionViewNode::take_ct(const msg::CtVolumeConstPtr& message) try {
  auto ct = std::make_shared<FusionCt>();
  ct->volume = from_message(*message, "ct/volume");
  ct->crc32 = message->crc32;
  update([&](FusionSceneKeeper& keeper) { keeper.take(std::shared_ptr<const FusionCt>(ct)); });
} catch (const InputError& error) {
  ROS_ERROR("%s", error.what());
}

std::optional<FramedPoint> FusionViewNode::placed(const geometry_msgs::PointStamped& message,
                                                  const std::string& fixed) const {
  const Eigen::Vector3d p_mm = point_from_message_mm(message.point);
  const std::string& frame = message.header.frame_id;
  if (!p_mm.allFinite()) return std::nullopt;
  if (frame.empty()) throw InputError("fusion/centre", "'header.frame_id' is empty");
  if (fixed.empty()) throw InputError("fusion/centre", "is not used before there is ultrasound");
  if (frame == fixed) return FramedPoint{frame, p_mm};
  require_stamped(message.header.stamp, ::ros::Time::now(), "fusion/centre");
  const Eigen::Isometry3d T_fixed_frame = from_message_mm(
      wait_for_transform(tf_, fixed, frame, message.header.stamp, tf_timeout_s_).transform, "tf");
  return FramedPoint{fixed, T_fixed_frame * p_mm};
}

void FusionViewNode::take_centre(const geometry_msgs::PointStampedConstPtr& message) try {
  std::string fixed;
  {
    const std::lock_guard lock(mutex_);
    if (const FusionScene scene = keeper_->scene(); scene.us) fixed = scene.us->fixed_frame;
  }
  const std::optional<FramedPoint> centre = placed(*message, fixed);
  update([&](FusionSceneKeeper& keeper) {
    keeper.set_centre(centre);
    centre_problem_.clear();
  });
} catch (const std::exception& error) {
  ROS_ERROR("%s", error.what());
  const std::lock_guard lock(mutex_);
  centre_problem_ = std::string("the point is not used: ") + error.what();
}

bool FusionViewNode::set_mode(msg::SetFusionMode::Request& request,
                              msg::SetFusionMode::Response& response) {
  const std::optional<FusionMode> mode = fusion_mode_named(request.mode);
  if (mode) update([&](FusionSceneKeeper& keeper) { keeper.set_mode(*mode); });
  std::string all;
  for (const std::string& name : fusion_mode_names()) all += (all.empty() ? "" : ", ") + name;
  response.status = mode ? status(Code::OK, "the mode is " + request.mode)
                         : status(Code::INVALID_REQUEST,
                                  "'mode' is '" + request.mode + "', must be one of " + all);
  return true;
}

bool FusionViewNode::save(msg::SaveFusion::Request& request, msg::SaveFusion::Response& response) {
  try {
    save_as(request.path);
    response.status = status(Code::OK, "saved as " + request.path);
  } catch (const Refusal& refusal) {
    response.status = refusal.status();
  } catch (const PathRefused& refusal) {
    response.status = status(Code::PATH_REFUSED, refusal.what());
  } catch (const std::exception& error) {
    response.status = status(Code::INVALID_REQUEST, error.what());
  }
  return true;
}

void FusionViewNode::save_as(const std::string& given) {
  if (!save_root_) throw Refusal(Code::PATH_REFUSED, "parameter save_root is not set");
  const std::filesystem::path path = save_root_->resolve_new(given, "path");
  if (path.extension() != ".png")
    throw Refusal(Code::INVALID_REQUEST, "'path' is '" + given + "', must end in .png");
  const Picture sheet = newest_sheet();
  try {
    write_png(sheet, path);
  } catch (const std::exception& error) {
    throw Refusal(Code::FILE_ERROR, without_names(error.what(), path, given));
  }
}

Picture FusionViewNode::newest_sheet() {
  constexpr std::chrono::seconds kLongest(60);
  std::unique_lock lock(mutex_);
  const std::uint64_t wanted = state_;
  const auto is_done = [&] {
    return is_ending_ || (drawn_state_ >= wanted && (drawn_ || !problem_.empty()));
  };
  ++waiting_;
  changed_.notify_all();
  const bool has_ended = changed_.wait_for(lock, kLongest, is_done);
  --waiting_;
  if (has_ended && drawn_) return drawn_->view.sheet;
  if (has_ended && !keeper_->scene().us) throw Refusal(Code::NO_ULTRASOUND, problem_);
  throw Refusal(Code::FAILED, has_ended ? problem_ : "nothing was drawn within 60 s");
}

void FusionViewNode::show(const ::ros::SingleSubscriberPublisher& subscriber,
                          Picture FusionView::*picture) {
  {
    const std::lock_guard lock(mutex_);
    if (drawn_ && drawn_->state == state_)
      subscriber.publish(to_message(drawn_->view.*picture, drawn_->header));
  }
  changed_.notify_all();
}

bool FusionViewNode::is_wanted() const {
  if (waiting_ > 0) return true;
  for (const ::ros::Publisher& publisher : publishers_)
    if (publisher.getNumSubscribers() > 0) return true;
  return false;
}

void FusionViewNode::run() {
  FusionPainter painter(pixel_mm_);
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return is_ending_ || (drawn_state_ != state_ && is_wanted()); });
    if (is_ending_) return;
    draw(painter, lock);
    changed_.notify_all();
  }
}

void FusionViewNode::draw(FusionPainter& painter, std::unique_lock<std::mutex>& lock) {
  const FusionScene scene = keeper_->scene();
  auto drawn = std::make_shared<Drawn>();
  drawn->state = state_;
  std::string problem = scene.us ? "" : "no ultrasound has arrived";
  if (scene.us) {
    lock.unlock();
    const ::ros::WallTime begin = ::ros::WallTime::now();
    try {
      drawn->view = painter.paint(scene);
      drawn->header = scene.us->header;
    } catch (const std::exception& error) {
      problem = std::string("the view cannot be drawn: ") + error.what();
      ROS_ERROR("%s", problem.c_str());
    }
    lock.lock();
    seconds_ = (::ros::WallTime::now() - begin).toSec();
    ++drawings_;
  }
  drawn_state_ = drawn->state;
  problem_ = problem;
  drawn_.reset();
  // A decision that came meanwhile is drawn next; the picture would belie it.
  if (!problem.empty() || !keeper_->is_current(scene)) return;
  headline_ = scene.pose.headline;
  drawn_ = drawn;
  publish(*drawn);
}

void FusionViewNode::publish(const Drawn& drawn) const {
  for (std::size_t i = 0; i < kOutputs.size(); ++i)
    if (publishers_[i].getNumSubscribers() > 0)
      publishers_[i].publish(to_message(drawn.view.*kOutputs[i].picture, drawn.header));
}

void FusionViewNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  using diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard lock(mutex_);
  const FusionScene scene = keeper_->scene();
  if (!scene.us)
    diagnosis.summary(DiagnosticStatus::OK, "waiting for ultrasound");
  else if (!is_wanted())
    diagnosis.summary(DiagnosticStatus::OK, "nobody subscribes to the view");
  else if (!problem_.empty())
    diagnosis.summary(DiagnosticStatus::ERROR, problem_);
  else
    diagnosis.summary(DiagnosticStatus::OK, drawn_ ? headline_ : "the view is being drawn");
  const std::string warning = scene.us ? scene.us->warning : "";
  for (const std::string& problem :
       {ultrasound_problem_, centre_problem_, warning, keeper_->alignment_problem()})
    if (!problem.empty()) diagnosis.mergeSummary(DiagnosticStatus::WARN, problem);
  for (const auto& [mode, name] : words_of(FusionMode{}))
    if (scene.us && mode == scene.mode) diagnosis.add("mode", name);
  if (scene.us) diagnosis.add("stamp of the ultrasound (s)", seconds_text(scene.us->header.stamp));
  diagnosis.add("CT", scene.ct ? "received" : "none");
  diagnosis.add("pose", scene.pose.headline);
  diagnosis.add("drawings", drawings_);
  diagnosis.add("time of the last drawing (s)", seconds_);
}

}  // namespace usct::ros_interface
