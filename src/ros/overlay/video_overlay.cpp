#include "ros/overlay/video_overlay.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "ros/overlay/scene_topics.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using XmlRpc::XmlRpcValue;

bool as_flag(XmlRpcValue value, const std::string& name) {
  if (value.getType() != XmlRpcValue::TypeBoolean) throw InputError(name, "must be true or false");
  return static_cast<bool>(value);
}

double as_share(XmlRpcValue value, const std::string& name) {
  const bool is_whole = value.getType() == XmlRpcValue::TypeInt;
  double found = std::numeric_limits<double>::quiet_NaN();
  if (is_whole) found = static_cast<int>(value);
  if (value.getType() == XmlRpcValue::TypeDouble) found = static_cast<double>(value);
  if (!(found >= 0.0 && found <= 1.0)) throw InputError(name, "must be a number in [0, 1]");
  return found;
}

Picture::Colour as_colour(XmlRpcValue value, const std::string& name) {
  if (value.getType() != XmlRpcValue::TypeArray || value.size() != 3)
    throw InputError(name, "must be a list of red, green and blue in [0, 1]");
  Picture::Colour colour;
  for (int i = 0; i < 3; ++i)
    colour[i] = static_cast<std::uint8_t>(std::lround(255.0 * as_share(value[i], name)));
  return colour;
}

std::map<std::string, StructureStyle> read_styles(Parameters& parameters) {
  std::map<std::string, StructureStyle> styles;
  for (const auto& [structure, members] : parameters.groups("structures")) {
    StructureStyle& style = styles[structure];
    for (const auto& [key, value] : members) {
      const std::string name = "structures/" + structure + "/" + key;
      if (key == "visible")
        style.is_visible = as_flag(value, name);
      else if (key == "band")
        style.has_band = as_flag(value, name);
      else if (key == "opacity")
        style.opacity = as_share(value, name);
      else if (key == "colour")
        style.colour = as_colour(value, name);
      else
        throw InputError(name,
                         "is not a parameter; a structure has: band, colour, opacity, visible");
    }
  }
  return styles;
}

}  // namespace

VideoOverlay::VideoOverlay(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node),
      plugin_namespace_(private_node.getNamespace()),
      diagnostics_(node, private_node, private_node.getNamespace()) {
  Parameters parameters(private_node);
  read_parameters(parameters);
  const double diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  keeper_ = std::make_unique<OverlaySceneKeeper>(scene_options_);
  tf_ = std::make_unique<TfBuffer>(::ros::Duration(tf2::BufferCore::DEFAULT_CACHE_TIME),
                                   max_tf_gap_s_);
  tf_input_ = std::make_unique<TfInput>(*tf_, node_);
  subscribers_ = subscribe_to_scene(node_, *keeper_);
  status_publisher_ = node_.advertise<msg::OverlayStatus>("overlay/status", 10);
  diagnostics_.setHardwareID("none");
  sides_ = is_stereo_ ? std::vector<std::string>{"left", "right"} : std::vector<std::string>{""};
  for (const std::string& side : sides_) add_camera(side, painting_);
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); }));
}

/// The thread of each camera of a pair looks at the other camera.
VideoOverlay::~VideoOverlay() {
  for (const auto& camera : cameras_) camera->stop();
}

void VideoOverlay::read_parameters(Parameters& parameters) {
  is_stereo_ = parameters.flag("stereo", false);
  is_rectified_ = parameters.flag("rectified", false);
  has_own_frame_ = parameters.flag("own_frame", false);
  transport_ = parameters.image_transport();
  max_stereo_skew_s_ = parameters.number("max_stereo_skew", 0.02, 0.0, 10.0);
  scene_options_.styles = read_styles(parameters);
  scene_options_.bound_factor =
      parameters.number("bound_factor", scene_options_.bound_factor, 0.1, 100.0);
  scene_options_.old_after_s = parameters.number("old_after", 1800.0, 0.0, 1e6);
  painting_.tf_timeout_s = parameters.number("tf_timeout", 0.1, 0.0, 10.0);
  // A camera moves much within the time over which the slow poses of a probe are interpolated.
  constexpr double kMaxGapS = 0.2;
  max_tf_gap_s_ = parameters.number("max_tf_gap", kMaxGapS, 0.0, 10.0);
  painting_.camera_error_px = parameters.number("camera_error_px", 1.0, 0.0, 1000.0);
  painting_.hand_eye_error_mm = kMmPerM * parameters.number("hand_eye_error", 0.001, 0.0, 1.0);
  painting_.hand_eye_error_rad = parameters.number("hand_eye_angle_error", 0.01, 0.0, 1.0);
  painting_.drawing.outline_px = parameters.number("outline_px", 3.0, 1.0, 50.0);
  painting_.drawing.hidden_depth_mm =
      kMmPerM * parameters.number("hidden_depth", 0.015, 1e-4, 10.0);
  painting_.drawing.band_opacity = parameters.number("band_opacity", 0.3, 0.0, 1.0);
}

void VideoOverlay::add_camera(const std::string& side, const OverlayPainterOptions& painting) {
  const std::size_t eye = cameras_.size();
  const std::string folder = side.empty() ? "" : side + "/";
  OverlayCameraOptions options;
  options.input = "endoscope/" + folder + "image_raw";
  if (eye == kRight) options.left = "endoscope/left/image_raw";
  options.output = "overlay/" + folder + "image";
  options.transport = transport_;
  options.plugin_namespace = plugin_namespace_;
  cameras_.push_back(std::make_unique<OverlayCamera>(
      node_, options, OverlayPainter(painting, *keeper_, *tf_),
      [this, eye](OverlayJob& job) { complete(eye, job); },
      [this, side](const msg::OverlayStatus& status) {
        msg::OverlayStatus named = status;
        named.camera = side;
        status_publisher_.publish(named);
      }));
  diagnostics_.add(side.empty() ? "overlay" : "overlay " + side,
                   [this, eye](diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
                     diagnose(eye, diagnosis);
                   });
}

void VideoOverlay::complete(std::size_t eye, OverlayJob& job) const {
  job.use.is_rectified = is_rectified_;
  if (!is_stereo_) {
    if (job.info && job.info->P[3] != 0.0 && !has_own_frame_) {
      job.info = nullptr;
      job.problem =
          "the camera_info is that of the right camera of a pair (P[3] is not 0), whose frame may "
          "be "
          "the left one's: draw into both (stereo), or set own_frame if the frame is its own";
    }
    return;
  }
  job.warning = out_of_step(eye);
  if (eye != kRight || !job.info) return;
  const sensor_msgs::CameraInfoConstPtr left = cameras_[kRight]->left_info();
  if (!left) {
    job.info = nullptr;
    job.problem = "no camera_info of the left camera, in whose frame the right one may be";
  } else if (left->header.frame_id == job.info->header.frame_id) {
    job.use.R_of_left = rectification_of(*left);
  }
}

std::string VideoOverlay::out_of_step(std::size_t eye) const {
  const std::deque<::ros::Time> own = cameras_[eye]->newest_stamps();
  const std::deque<::ros::Time> other = cameras_[1 - eye]->newest_stamps();
  // Images are received only while somebody looks at them.
  if (own.size() < 2 || !cameras_[1 - eye]->is_subscribed()) return {};
  if (other.empty())
    return std::string("OUT OF STEP: no image of the ") + sides_[1 - eye] + " camera";
  // The partner of the newest image may be on its way.
  double skew_s = std::numeric_limits<double>::infinity();
  for (const ::ros::Time& stamp : other)
    skew_s = std::min(skew_s, std::abs(seconds_between(stamp, own[own.size() - 2])));
  if (skew_s <= max_stereo_skew_s_) return {};
  return "OUT OF STEP: left and right image are " + seconds_text(skew_s) + " s apart";
}

void VideoOverlay::diagnose(std::size_t eye,
                            diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  using diagnostic_msgs::DiagnosticStatus;
  const OverlayCameraReport report = cameras_[eye]->report();
  const msg::OverlayStatus& status = report.status;
  if (!report.is_subscribed)
    diagnosis.summary(DiagnosticStatus::OK, "nobody subscribes to the overlay");
  else if (report.received == 0)
    diagnosis.summary(DiagnosticStatus::WARN, "no image has arrived");
  else if (status.state == msg::OverlayStatus::NOTHING)
    diagnosis.summary(DiagnosticStatus::ERROR, "nothing is drawn: " + status.message);
  else if (status.state == msg::OverlayStatus::DRAWN_WITH_WARNING)
    diagnosis.summary(DiagnosticStatus::WARN, status.message);
  else
    diagnosis.summary(DiagnosticStatus::OK, "drawn");
  if (const std::string misnamed = keeper_->misnamed(); !misnamed.empty())
    diagnosis.mergeSummary(DiagnosticStatus::WARN, misnamed);
  diagnosis.add("images received", report.received);
  diagnosis.add("images published", report.published);
  diagnosis.add("images with overlay", report.drawn);
  diagnosis.add("images dropped for a newer one", report.dropped);
  diagnosis.add("latency (ms)", 1000.0 * report.latency_s);
  diagnosis.add("longest latency (ms)", 1000.0 * report.longest_latency_s);
  diagnosis.add("radius of the band (mm)", kMmPerM * status.error_bound);
  diagnosis.add("stamp of the newest image", seconds_text(status.header.stamp));
}

}  // namespace usct::ros_interface
