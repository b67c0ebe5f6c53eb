// The panel as rviz loads it, with its buttons pressed: beside a tf_publisher, and beside a
// registration that answers, hangs or is missing, which this program plays.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PointStamped.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rviz/panel.h>
#include <sensor_msgs/Image.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/Cancel.h>
#include <us_ct_registration/CtInfo.h>
#include <us_ct_registration/Register.h>
#include <us_ct_registration/SetInitialAlignment.h>

#include <QApplication>
#include <QElapsedTimer>
#include <QGroupBox>
#include <QLabel>
#include <QPlainTextEdit>
#include <QPushButton>
#include <QTableWidget>
#include <QtTest/QTest>
#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <pluginlib/class_loader.hpp>

namespace {

namespace msg = us_ct_registration;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kLimitMs = 30000;
constexpr std::uint32_t kCtCrc32 = 7;

/// The node `registration`, as far as the panel sees it.
class FakeRegistration {
 public:
  FakeRegistration()
      : results_(node_.advertise<msg::RegistrationResult>("registration/result", 1, true)),
        ct_(node_.advertise<msg::CtInfo>("registration/ct", 1, true)),
        register_(node_.advertiseService("register", &FakeRegistration::on_register, this)),
        cancel_(node_.advertiseService("registration/cancel", &FakeRegistration::on_cancel, this)),
        set_(node_.advertiseService("registration/set_initial_alignment", &FakeRegistration::on_set,
                                    this)) {
    msg::CtInfo info;
    info.header.frame_id = "ct";
    info.crc32 = kCtCrc32;
    ct_.publish(info);
  }

  static msg::RegistrationResult registered(std::uint64_t id) {
    msg::RegistrationResult result;
    result.id = id;
    result.ct_frame = "ct";
    result.ct_crc32 = kCtCrc32;
    result.fixed_frame = "patient";
    result.status.code = msg::StatusCode::REGISTERED;
    result.status.message = "found it";
    result.transform.rotation.w = result.fixed_transform.rotation.w = 1.0;
    result.candidates.resize(1);
    result.candidates[0].transform.rotation.w = 1.0;
    result.measures.resize(2);
    result.measures[0].name = "wrong_probability";
    result.measures[0].value = 0.125;
    result.measures[1].name = "expected_error_mm";
    result.measures[1].value = 1.25;
    return result;
  }

  std::function<msg::RegistrationResult()> answer;
  std::atomic<bool> hangs{false};
  std::atomic<int> cancels{0};
  std::mutex mutex;
  msg::SetInitialAlignment::Request initial;  // guarded by `mutex`

 private:
  bool on_register(msg::Register::Request&, msg::Register::Response& response) {
    while (hangs && ros::ok()) ros::WallDuration(0.01).sleep();
    response.result = answer();
    response.success = response.result.status.code == msg::StatusCode::REGISTERED;
    response.message = response.result.status.message;
    results_.publish(response.result);
    return true;
  }
  bool on_cancel(msg::Cancel::Request&, msg::Cancel::Response& response) {
    ++cancels;
    response.status.code = msg::StatusCode::OK;
    response.status.message = "it is cancelled";
    hangs = false;
    return true;
  }
  bool on_set(msg::SetInitialAlignment::Request& request,
              msg::SetInitialAlignment::Response& response) {
    const std::lock_guard<std::mutex> lock(mutex);
    initial = request;
    response.status.code = msg::StatusCode::OK;
    response.status.message = "registrations start from it";
    response.residual = 0.0015;
    return true;
  }

  ros::NodeHandle node_;
  ros::Publisher results_;
  ros::Publisher ct_;
  ros::ServiceServer register_;
  ros::ServiceServer cancel_;
  ros::ServiceServer set_;
};

/// Set by main.
pluginlib::ClassLoader<rviz::Panel>* loader = nullptr;

class RvizPanel : public testing::Test {
 protected:
  RvizPanel() : panel_(loader->createUnmanagedInstance("us_ct_registration/RegistrationPanel")) {
    panel_->resize(450, 900);
    panel_->show();
  }

  template <class Widget>
  Widget& find(const char* name) {
    auto* widget = panel_->findChild<Widget*>(name);
    if (widget == nullptr) throw std::runtime_error(std::string("no widget ") + name);
    return *widget;
  }
  bool is_enabled(const char* name) { return find<QPushButton>(name).isEnabled(); }
  std::string words(const char* name) { return find<QLabel>(name).text().toStdString(); }
  std::string evidence() { return find<QPlainTextEdit>("evidence").toPlainText().toStdString(); }

  void wait_for(const std::function<bool()>& condition, const std::string& what) {
    EXPECT_TRUE(QTest::qWaitFor(condition, kLimitMs)) << what << "; the panel says:\n"
                                                      << words("answer") << "\n"
                                                      << words("in_force") << "\n"
                                                      << words("headline") << "\n"
                                                      << words("nodes");
  }
  void wait_words(const char* name, const std::string& part) {
    wait_for([&] { return words(name).find(part) != std::string::npos; },
             std::string(name) + " to say " + part);
  }
  void press(const char* name) {
    wait_for([&] { return is_enabled(name); }, std::string(name) + " to be enabled");
    QTest::mouseClick(&find<QPushButton>(name), Qt::LeftButton);
  }
  static std::uint64_t new_id() { return ros::WallTime::now().toNSec() / 1'000'000; }

  std::unique_ptr<rviz::Panel> panel_;
};

TEST_F(RvizPanel, SaysThatNodesAreMissing) {
  wait_words("in_force", "nothing is accepted");
  EXPECT_TRUE(is_enabled("register"));
  for (const char* name : {"cancel", "accept", "reject", "revert"})
    EXPECT_FALSE(is_enabled(name)) << name;
  EXPECT_THAT(words("nodes"), HasSubstr("not heard"));
  press("register");
  wait_words("answer", "nobody offers the service '/register'");
  EXPECT_TRUE(is_enabled("register"));
}

TEST_F(RvizPanel, RegistersAsksAcceptsAndReverts) {
  FakeRegistration registration;
  const std::uint64_t id = new_id();
  registration.answer = [id] { return FakeRegistration::registered(id); };
  press("register");
  const std::string name = "result " + std::to_string(id);
  wait_words("headline", "WAITING: " + name);
  EXPECT_THAT(words("headline"), HasSubstr("found it"));
  EXPECT_THAT(evidence(), AllOf(HasSubstr("more than 5 mm off: 0.125"), HasSubstr("1.25 mm")));
  EXPECT_FALSE(is_enabled("revert"));
  EXPECT_FALSE(is_enabled("accept")) << "nobody can have looked at it yet";
  press("accept");
  wait_words("answer", name + " is accepted");
  wait_words("in_force", name + " is broadcast");
  wait_words("headline", "ACCEPTED");
  // A second tf_publisher says that the CT is elsewhere.
  ros::NodeHandle node;
  const auto accepted = ros::topic::waitForMessage<msg::Alignment>("registration/alignment", node,
                                                                   ros::Duration(10.0));
  ASSERT_TRUE(accepted);
  auto alignments = node.advertise<msg::Alignment>("registration/alignment", 1);
  wait_for([&] { return alignments.getNumSubscribers() > 0; }, "a subscriber of the alignment");
  msg::Alignment elsewhere = *accepted;
  elsewhere.transform.translation.x += 0.01;
  alignments.publish(elsewhere);
  wait_words("headline", "tf has the CT where another alignment has it");
  EXPECT_THAT(words("in_force"), HasSubstr("not in force"));
  elsewhere.transform.translation.x -= 0.01;
  alignments.publish(elsewhere);
  wait_words("headline", "ACCEPTED");
  wait_for([&] { return !is_enabled("accept") && !is_enabled("reject"); }, "nothing to wait");
  press("revert");
  wait_words("in_force", "nothing is accepted");
}

TEST_F(RvizPanel, RejectsAndShowsARefusal) {
  FakeRegistration registration;
  const std::uint64_t id = new_id();
  registration.answer = [id] { return FakeRegistration::registered(id); };
  press("register");
  press("reject");
  wait_words("answer", "result " + std::to_string(id) + " is rejected");
  registration.answer = [] {
    msg::RegistrationResult refused = FakeRegistration::registered(new_id());
    refused.status.code = msg::StatusCode::LOW_CONFIDENCE;
    refused.status.message = "the halves disagree";
    return refused;
  };
  press("register");
  wait_words("headline", "REFUSED, LOW_CONFIDENCE: the halves disagree");
  wait_words("answer", "the halves disagree");
  EXPECT_FALSE(is_enabled("accept"));
  EXPECT_THAT(words("in_force"), HasSubstr("nothing is accepted"));
}

TEST_F(RvizPanel, StaysAliveBesideARegistrationThatHangs) {
  FakeRegistration registration;
  registration.hangs = true;
  registration.answer = [] {
    msg::RegistrationResult cancelled;
    cancelled.status.code = msg::StatusCode::CANCELLED;
    cancelled.status.message = "the caller cancelled it";
    return cancelled;
  };
  press("register");
  // Of a window that a call held up, not one of these events would be handled.
  QElapsedTimer since;
  qint64 longest_ms = 0;
  since.start();
  for (QElapsedTimer all = since; all.elapsed() < 1500;) {
    QTest::qWait(10);
    longest_ms = std::max(longest_ms, since.restart());
  }
  EXPECT_LT(longest_ms, 700);
  EXPECT_THAT(words("answer"), HasSubstr("registering"));
  EXPECT_FALSE(is_enabled("register"));
  press("cancel");
  wait_words("answer", "the caller cancelled it");
  EXPECT_EQ(registration.cancels, 1);
  wait_for([&] { return is_enabled("register") && !is_enabled("cancel"); }, "the end");
}

TEST_F(RvizPanel, ShowsThePictureOfFusionView) {
  ros::NodeHandle node;
  auto images = node.advertise<sensor_msgs::Image>("fusion/sheet", 1, true);
  auto diagnostics = node.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 1, true);
  sensor_msgs::Image image;
  image.encoding = "rgb8";
  image.width = 40;
  image.height = 30;
  image.step = 3 * image.width;
  image.data.assign(image.step * image.height, 0);
  for (std::size_t i = 0; i < image.data.size(); i += 3) image.data[i + 1] = 200;
  images.publish(image);
  auto& picture = find<QWidget>("picture");
  const auto is_green = [&] {
    const QColor middle = picture.grab().toImage().pixelColor(picture.rect().center());
    return middle == QColor(0, 200, 0);
  };
  wait_for(is_green, "the picture");
  EXPECT_THAT(words("picture_warning"), HasSubstr("fusion_view is silent"));
  diagnostic_msgs::DiagnosticArray array;
  array.status.resize(1);
  array.status[0].name = "fusion_view: view";
  array.status[0].message = "drawn";
  diagnostics.publish(array);
  wait_for([&] { return words("picture_warning").empty(); }, "the warning to end");
  // An image whose sizes lie must not be read.
  image.height = 30000;
  images.publish(image);
  QTest::qWait(300);
  EXPECT_TRUE(is_green());
}

TEST_F(RvizPanel, CollectsLandmarksAndSendsThem) {
  FakeRegistration registration;
  ros::NodeHandle node;
  auto clicks = node.advertise<geometry_msgs::PointStamped>("/clicked_point", 10);
  wait_for([&] { return clicks.getNumSubscribers() > 0; }, "a subscriber of the tool");
  auto& pairs = find<QTableWidget>("pairs");
  const auto click = [&](const char* frame, double x, double y) {
    geometry_msgs::PointStamped point;
    point.header.frame_id = frame;
    point.point.x = x;
    point.point.y = y;
    clicks.publish(point);
  };
  click("ct", 9, 9);
  QTest::qWait(300);
  EXPECT_EQ(pairs.rowCount(), 0) << "nobody asked for landmarks";

  find<QGroupBox>("landmarks").setChecked(true);
  wait_words("hint", "landmark 1 in the CT");
  click("patient", 1, 1);
  wait_words("hint", "must come first");
  const double corners[][2] = {{0, 0}, {1, 0}, {0, 1}, {5, 5}};
  for (int i = 0; i < 4; ++i) {
    click("ct", corners[i][0], corners[i][1]);
    wait_for([&] { return pairs.rowCount() == i + 1; }, "a point in the CT");
    EXPECT_FALSE(is_enabled("send"));
    click("patient", corners[i][0] + 0.01, corners[i][1]);
    wait_for([&] { return pairs.item(i, 1)->text() != "-"; }, "a point in the ultrasound");
  }
  EXPECT_EQ(pairs.item(1, 0)->text(), "1000.0, 0.0, 0.0");
  EXPECT_EQ(pairs.item(1, 1)->text(), "1010.0, 0.0, 0.0");
  pairs.selectRow(3);
  press("remove");
  EXPECT_EQ(pairs.rowCount(), 3);
  press("send");
  wait_words("hint", "registrations start from it; the landmarks agree to 1.5 mm");
  const std::lock_guard<std::mutex> lock(registration.mutex);
  EXPECT_EQ(registration.initial.type, msg::SetInitialAlignment::Request::LANDMARKS);
  EXPECT_EQ(registration.initial.header.frame_id, "patient");
  ASSERT_EQ(registration.initial.points.size(), 3U);
  EXPECT_EQ(registration.initial.points_ct[2].y, 1.0);
  EXPECT_EQ(registration.initial.points[2].x, 0.01);
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_rviz_panel");
  qputenv("QT_QPA_PLATFORM", "offscreen");
  pluginlib::ClassLoader<rviz::Panel> panels("rviz", "rviz::Panel");
  loader = &panels;
  QApplication application(argc, argv);
  ros::NodeHandle keep_alive;
  // The nodes that this program plays.
  ros::AsyncSpinner spinner(4);
  spinner.start();
  return RUN_ALL_TESTS();
}
