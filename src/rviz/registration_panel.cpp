#include "rviz/registration_panel.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <diagnostic_msgs/DiagnosticStatus.h>
#include <us_ct_registration/Cancel.h>
#include <us_ct_registration/Decide.h>
#include <us_ct_registration/Register.h>

#include <QFontDatabase>
#include <QHBoxLayout>
#include <QImage>
#include <QLabel>
#include <QPlainTextEdit>
#include <QPushButton>
#include <QVBoxLayout>
#include <pluginlib/class_list_macros.hpp>

#include "ros/conversions/images.h"
#include "rviz/landmark_box.h"
#include "rviz/picture_view.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using diagnostic_msgs::DiagnosticStatus;
using Seconds = ServiceCalls::Seconds;

/// Decisions take a fraction of a second; tf_publisher answers once tf shows them.
constexpr Seconds kDecisionLimit(10.0);
/// A search in all orientations may take a minute.
constexpr Seconds kRegistrationLimit(600.0);
/// The nodes speak once a second.
constexpr double kSilenceS = 5.0;
constexpr int kTickMs = 50;
/// A result that comes just before the click on another must not be accepted by it.
constexpr double kLookS = 1.0;

const std::vector<std::string> kNodes = {"us_ingest",    "ct_server", "registration",
                                         "tf_publisher", "us_cloud",  "fusion_view"};

/// The namespace of a node handle as diagnostics have it, "" or "robot/".
std::string prefix_of(const ::ros::NodeHandle& node) {
  const std::string name = node.resolveName("x");
  return name.substr(1, name.size() - 2);
}

const char* colour_of(PoseStanding standing) {
  switch (standing) {
    case PoseStanding::kWaiting:
      return "#ffcc66";
    case PoseStanding::kAccepted:
      return "#b8e6b8";
    case PoseStanding::kRefused:
      return "#ff9c94";
    case PoseStanding::kNone:
      break;
  }
  return "#d8d8d8";
}

const char* colour_of_level(std::uint8_t level) {
  switch (level) {
    case DiagnosticStatus::OK:
      return "#107010";
    case DiagnosticStatus::WARN:
      return "#a06000";
    default:
      return "#c00000";
  }
}

QLabel* label(const char* name) {
  auto* made = new QLabel;
  made->setObjectName(name);
  made->setWordWrap(true);
  made->setTextFormat(Qt::PlainText);
  made->setTextInteractionFlags(Qt::TextSelectableByMouse);
  return made;
}

}  // namespace

RegistrationPanel::RegistrationPanel()
    : node_(with_queue(::ros::NodeHandle(), guarded_)),
      nodes_(prefix_of(node_), kNodes, kSilenceS) {
  clock_.start();
  build();
  subscribe();
  connect(&timer_, &QTimer::timeout, [this] { tick(); });
  timer_.start(kTickMs);
  tick();
}

// Qt would delete the box after the members, but the box subscribes by the queue.
RegistrationPanel::~RegistrationPanel() { delete landmarks_; }

void RegistrationPanel::onInitialize() { landmarks_->use(*vis_manager_); }

QPushButton* RegistrationPanel::add_button(OperatorAction action, const char* name,
                                           const QString& text) {
  auto* button = new QPushButton(text);
  button->setObjectName(name);
  connect(button, &QPushButton::clicked, [this, action] { request(action); });
  buttons_[action] = button;
  return button;
}

QWidget* RegistrationPanel::build_decision() {
  auto* frame = new QWidget;
  headline_ = label("headline");
  evidence_ = new QPlainTextEdit;
  evidence_->setObjectName("evidence");
  evidence_->setReadOnly(true);
  evidence_->setMaximumHeight(150);
  auto* row = new QHBoxLayout;
  row->addWidget(add_button(OperatorAction::kAccept, "accept", tr("Accept")));
  row->addWidget(add_button(OperatorAction::kReject, "reject", tr("Reject")));
  auto* column = new QVBoxLayout(frame);
  column->setContentsMargins(0, 0, 0, 0);
  column->addWidget(headline_);
  column->addLayout(row);
  column->addWidget(evidence_);
  return frame;
}

void RegistrationPanel::build() {
  answer_ = label("answer");
  in_force_ = label("in_force");
  nodes_label_ = label("nodes");
  nodes_label_->setTextFormat(Qt::RichText);
  picture_warning_ = label("picture_warning");
  picture_warning_->setStyleSheet("color: #c00000");
  picture_ = new PictureView;
  picture_->setObjectName("picture");
  picture_->setMinimumSize(200, 150);
  landmarks_ = new LandmarkBox(node_, calls_);
  auto* asking = new QHBoxLayout;
  asking->addWidget(add_button(OperatorAction::kRegister, "register", tr("Register")), 2);
  asking->addWidget(add_button(OperatorAction::kCancel, "cancel", tr("Cancel")), 1);
  auto* counting = new QHBoxLayout;
  counting->addWidget(in_force_, 2);
  counting->addWidget(add_button(OperatorAction::kRevert, "revert", tr("Revert")), 1);
  auto* column = new QVBoxLayout(this);
  column->addLayout(asking);
  column->addWidget(answer_);
  column->addLayout(counting);
  column->addWidget(build_decision());
  column->addWidget(picture_warning_);
  column->addWidget(picture_, 1);
  column->addWidget(landmarks_);
  column->addWidget(nodes_label_);
}

void RegistrationPanel::subscribe() {
  alignment_ = node_.subscribe<msg::Alignment>(
      "registration/alignment", 1,
      [this](const msg::AlignmentConstPtr& message) { state_.take_alignment(*message); });
  proposed_ = node_.subscribe<msg::Alignment>(
      "registration/proposed", 1,
      [this](const msg::AlignmentConstPtr& message) { state_.take_proposed(*message); });
  result_ = node_.subscribe<msg::RegistrationResult>(
      "registration/result", 10,
      [this](const msg::RegistrationResultConstPtr& message) { state_.take_result(*message); });
  diagnostics_ = node_.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 20, [this](const diagnostic_msgs::DiagnosticArrayConstPtr& message) {
        nodes_.take(*message, now_s());
      });
  image_ = node_.subscribe("fusion/sheet", 1, &RegistrationPanel::take_picture, this);
}

double RegistrationPanel::now_s() const {
  constexpr double kSecondsPerMs = 1e-3;
  return kSecondsPerMs * static_cast<double>(clock_.elapsed());
}

void RegistrationPanel::request(OperatorAction action) {
  switch (action) {
    case OperatorAction::kRegister:
      return request_registration();
    case OperatorAction::kCancel:
      return request_cancel();
    case OperatorAction::kAccept:
      return request_decision(action, "registration/accept");
    case OperatorAction::kReject:
      return request_decision(action, "registration/reject");
    case OperatorAction::kRevert:
      return request_decision(action, "registration/revert");
  }
}

void RegistrationPanel::request_registration() {
  registering_since_s_ = now_s();
  state_.set_requested(OperatorAction::kRegister, true);
  calls_.start<msg::Register>(
      node_.resolveName("register"), {}, kRegistrationLimit,
      [this](const msg::Register::Response* response, const std::string& problem) {
        answered(OperatorAction::kRegister, response != nullptr ? response->message : problem,
                 response != nullptr && response->success != 0);
      });
  tick();
}

void RegistrationPanel::request_cancel() {
  state_.set_requested(OperatorAction::kCancel, true);
  // The registration that this panel requested says itself how it ended.
  const bool is_own = !state_.may(OperatorAction::kRegister);
  calls_.start<msg::Cancel>(
      node_.resolveName("registration/cancel"), {}, kDecisionLimit,
      [this, is_own](const msg::Cancel::Response* response, const std::string& problem) {
        const bool is_good = response != nullptr && response->status.code == msg::StatusCode::OK;
        if (is_own && is_good)
          state_.set_requested(OperatorAction::kCancel, false);
        else
          answered(OperatorAction::kCancel,
                   response != nullptr ? response->status.message : problem, is_good);
      });
  tick();
}

void RegistrationPanel::request_decision(OperatorAction action, const std::string& name) {
  // The number of what the panel shows: if a newer result has come meanwhile, it is refused.
  msg::Decide::Request request;
  request.result_id = state_.subject_id();
  state_.set_requested(action, true);
  calls_.start<msg::Decide>(
      node_.resolveName(name), request, kDecisionLimit,
      [this, action](const msg::Decide::Response* response, const std::string& problem) {
        answered(action, response != nullptr ? response->status.message : problem,
                 response != nullptr && response->status.code == msg::StatusCode::OK);
      });
  tick();
}

void RegistrationPanel::answered(OperatorAction action, const std::string& words, bool is_good) {
  state_.set_requested(action, false);
  answer_->setStyleSheet(is_good ? "" : "color: #c00000");
  answer_->setText(QString::fromStdString(words));
}

void RegistrationPanel::take_picture(const sensor_msgs::ImageConstPtr& image) {
  require_readable(*image, image_.getTopic());
  if (image->encoding != "rgb8")
    throw InputError(image_.getTopic(), "'encoding' is '" + image->encoding + "', must be 'rgb8'");
  const QImage shown(image->data.data(), static_cast<int>(image->width),
                     static_cast<int>(image->height), static_cast<int>(image->step),
                     QImage::Format_RGB888);
  picture_->set_picture(QPixmap::fromImage(shown));
}

void RegistrationPanel::tick() {
  queue_.callAvailable();
  calls_.poll();
  state_.look_up(tf_, ::ros::Time::now(), AlignmentWatch::Clock::now());
  state_.set_registering(nodes_.is_registering());
  if (state_.subject_id() != shown_id_) shown_since_s_ = now_s();
  shown_id_ = state_.subject_id();
  const bool is_new = now_s() - shown_since_s_ < kLookS;
  for (const auto& [action, button] : buttons_)
    button->setEnabled(state_.may(action) && !(is_new && action == OperatorAction::kAccept));
  if (!state_.may(OperatorAction::kRegister)) {
    answer_->setStyleSheet("");
    answer_->setText(tr("registering, %1 s").arg(now_s() - registering_since_s_, 0, 'f', 0));
  }
  answer_->setVisible(!answer_->text().isEmpty());
  show_decision();
  show_nodes();
}

void RegistrationPanel::show_decision() {
  const bool is_silent = nodes_.is_silent("tf_publisher", now_s());
  in_force_->setText(QString::fromStdString(
      state_.in_force() +
      (is_silent && state_.is_in_force() ? " - but tf_publisher is silent, see below" : "")));
  const OperatorSubject subject = state_.subject();
  headline_->setStyleSheet(
      QString("background: %1; color: black; padding: 4px").arg(colour_of(subject.standing)));
  headline_->setText(QString::fromStdString(subject.headline));
  // Setting the text would take the reader's selection and place away.
  if (const QString text = QString::fromStdString(subject.evidence);
      text != evidence_->toPlainText())
    evidence_->setPlainText(text);
  const bool is_old = !picture_->picture().isNull() && nodes_.is_silent("fusion_view", now_s());
  picture_warning_->setText(
      is_old ? tr("fusion_view is silent: this picture may show another state") : QString());
  picture_warning_->setVisible(is_old);
}

void RegistrationPanel::show_nodes() {
  QString text;
  for (const NodeLine& line : nodes_.lines(now_s()))
    text += QString("<div><b style='color: %1'>%2</b> %3</div>")
                .arg(colour_of_level(line.level), QString::fromStdString(line.name),
                     QString::fromStdString(line.text).toHtmlEscaped());
  if (text != nodes_label_->text()) nodes_label_->setText(text);
}

}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::RegistrationPanel, rviz::Panel)
