#include "rviz/landmark_box.h"

#include <us_ct_registration/CtInfo.h>

#include <QHBoxLayout>
#include <QHeaderView>
#include <QLabel>
#include <QPushButton>
#include <QTableWidget>
#include <QVBoxLayout>

#include "ros/conversions/poses.h"
#include "ros/conversions/surface_markers.h"
#include "rviz/ct_scene.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

QPushButton* button(const char* name, const QString& text) {
  auto* made = new QPushButton(text);
  made->setObjectName(name);
  return made;
}

QTableWidgetItem* cell(const geometry_msgs::Point& p) {
  return new QTableWidgetItem(QString::fromStdString(
      formatted("%.1f, %.1f, %.1f", kMmPerM * p.x, kMmPerM * p.y, kMmPerM * p.z)));
}

}  // namespace

LandmarkBox::LandmarkBox(::ros::NodeHandle& node, ServiceCalls& calls)
    : QGroupBox(tr("Landmarks, by the tool Publish Point")), node_(node), calls_(calls) {
  build();
  markers_ = node_.advertise<visualization_msgs::MarkerArray>("registration/landmarks", 1, true);
  ct_ = node_.subscribe<msg::CtInfo>("registration/ct", 1,
                                     [this](const msg::CtInfoConstPtr& message) {
                                       pairs_.hold_ct(message->header.frame_id, message->crc32);
                                       refresh();
                                     });
  surface_ = node_.subscribe("ct/surface", 1, &LandmarkBox::take_surface, this);
  points_ = node_.subscribe("/clicked_point", 10, &LandmarkBox::take_point, this);
  refresh();
}

LandmarkBox::~LandmarkBox() = default;

void LandmarkBox::build() {
  setObjectName("landmarks");
  setCheckable(true);
  setChecked(false);
  setFlat(true);
  show_ct_ = button("show_ct", tr("Show the CT alone"));
  show_ct_->setCheckable(true);
  remove_ = button("remove", tr("Remove"));
  send_ = button("send", tr("Start from these"));
  hint_ = new QLabel;
  hint_->setObjectName("hint");
  hint_->setWordWrap(true);
  table_ = new QTableWidget(0, 2);
  table_->setObjectName("pairs");
  table_->setHorizontalHeaderLabels({tr("CT, mm"), tr("ultrasound, mm")});
  table_->horizontalHeader()->setSectionResizeMode(QHeaderView::Stretch);
  table_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table_->setSelectionBehavior(QAbstractItemView::SelectRows);
  table_->setSelectionMode(QAbstractItemView::SingleSelection);
  table_->setFixedHeight(110);
  auto* content = new QWidget;
  auto* row = new QHBoxLayout;
  for (QPushButton* one : {show_ct_, remove_, send_}) row->addWidget(one);
  auto* column = new QVBoxLayout(content);
  column->setContentsMargins(0, 0, 0, 0);
  column->addLayout(row);
  column->addWidget(table_);
  auto* outer = new QVBoxLayout(this);
  outer->setContentsMargins(0, 0, 0, 0);
  outer->addWidget(content);
  outer->addWidget(hint_);
  content->setVisible(false);
  connect(this, &QGroupBox::toggled, [this, content](bool is_on) {
    content->setVisible(is_on);
    if (!is_on) show_ct_->setChecked(false);
    refresh();
  });
  connect(show_ct_, &QPushButton::toggled, [this](bool is_alone) { show_ct(is_alone); });
  connect(send_, &QPushButton::clicked, [this] { send(); });
  connect(table_, &QTableWidget::itemSelectionChanged,
          [this] { remove_->setEnabled(table_->currentRow() >= 0); });
  connect(remove_, &QPushButton::clicked, [this] {
    if (table_->currentRow() < 0) return;
    pairs_.remove(static_cast<std::size_t>(table_->currentRow()));
    refresh();
  });
}

void LandmarkBox::use(::rviz::VisualizationManager& manager) {
  scene_ = std::make_unique<CtScene>(manager);
}

void LandmarkBox::take_surface(const visualization_msgs::MarkerArrayConstPtr& message) {
  Eigen::AlignedBox3d box;
  for (const visualization_msgs::Marker& marker : message->markers)
    if (marker.action == visualization_msgs::Marker::ADD)
      box.extend(box_mm(marker, surface_.getTopic()));
  if (!box.isEmpty()) ct_middle_m_ = box.center() / kMmPerM;
}

void LandmarkBox::show_ct(bool is_alone) {
  if (scene_ == nullptr) return;
  if (!is_alone)
    scene_->show_all();
  else if (!pairs_.ct_frame().empty())
    scene_->show_ct_alone(pairs_.ct_frame(), ct_middle_m_);
}

void LandmarkBox::take_point(const geometry_msgs::PointStampedConstPtr& message) {
  if (!isChecked()) return;
  try {
    pairs_.add(message->header.frame_id, message->point);
    refresh();
  } catch (const InputError& error) {
    say(error.what());
  }
}

void LandmarkBox::send() {
  constexpr ServiceCalls::Seconds kLimit(10.0);
  try {
    const msg::SetInitialAlignment::Request request = pairs_.request();
    calls_.start<msg::SetInitialAlignment>(
        node_.resolveName("registration/set_initial_alignment"), request, kLimit,
        [this](const msg::SetInitialAlignment::Response* response, const std::string& problem) {
          if (response == nullptr)
            say(problem);
          else if (response->status.code != msg::StatusCode::OK)
            say(response->status.message);
          else
            say(response->status.message +
                formatted("; the landmarks agree to %.1f mm", kMmPerM * response->residual));
        });
  } catch (const InputError& error) {
    say(error.what());
  }
}

void LandmarkBox::refresh() {
  table_->setRowCount(static_cast<int>(pairs_.pairs().size()));
  for (int row = 0; row < table_->rowCount(); ++row) {
    const LandmarkPair& pair = pairs_.pairs()[static_cast<std::size_t>(row)];
    table_->setItem(row, 0, cell(pair.ct));
    table_->setItem(row, 1, pair.us ? cell(*pair.us) : new QTableWidgetItem(QString("-")));
  }
  table_->setCurrentItem(nullptr);
  remove_->setEnabled(false);
  send_->setEnabled(pairs_.is_ready());
  hint_->setVisible(isChecked());
  say(pairs_.next_step());
  markers_.publish(pairs_.markers());
}

void LandmarkBox::say(const std::string& words) { hint_->setText(QString::fromStdString(words)); }

}  // namespace usct::ros_interface
