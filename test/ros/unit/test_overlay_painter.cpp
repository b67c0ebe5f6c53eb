#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ros/time.h>

#include <algorithm>
#include <boost/make_shared.hpp>

#include "ros/conversions/poses.h"
#include "ros/conversions/surface_markers.h"
#include "ros/overlay/overlay_painter.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using msg::OverlayStatus;

constexpr int kPaintedWidth = 320;
constexpr int kPaintedHeight = 240;
constexpr std::uint8_t kGrey = 90;

/// A tumour of 10 mm, 100 mm before a camera whose frame is the patient's. The CT was aligned 60 s
/// before the image.
class OverlayPainterTest : public testing::Test {
 protected:
  OverlayPainterTest() {
    ::ros::Time::init();
    Surface tumour;
    tumour.points_mm = {{0, 0, 0}, {10, 0, 0}, {0, 10, 0}, {0, 0, 10}};
    tumour.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    keeper_.take_surface(to_markers({{1, tumour}}, {{1, {"tumour", {}}}}, "ct", 77));
    msg::CtInfo info;
    info.crc32 = 77;
    keeper_.take_info(info);
    const Isometry3d T_patient_ct(Translation3d(0.0, 0.0, 100.0));
    msg::Alignment alignment;
    alignment.state = msg::Alignment::ACCEPTED;
    alignment.header.frame_id = "patient";
    alignment.header.stamp = ::ros::Time(1000.0);
    alignment.ct_frame = "ct";
    alignment.ct_crc32 = 77;
    alignment.result_id = 5;
    alignment.expected_error = 0.001;
    alignment.transform = to_message(T_patient_ct);
    keeper_.take_alignment(alignment);
    know(kStamp, T_patient_ct, "ct");
    know(kStamp, Isometry3d::Identity(), "camera");
  }
  static OverlaySceneOptions with_band() {
    OverlaySceneOptions options;
    options.styles["tumour"].has_band = true;
    options.old_after_s = 120.0;
    return options;
  }
  void know(const ::ros::Time& stamp, const Isometry3d& T_patient_child, const std::string& child) {
    tf_.set_transform(stamped_transform(stamp, T_patient_child, "patient", child), "test");
  }
  Overlay painted(const OverlayPainterOptions& options) const {
    auto image = boost::make_shared<sensor_msgs::Image>();
    image->header.stamp = kStamp;
    image->header.frame_id = "camera";
    image->width = kPaintedWidth;
    image->height = kPaintedHeight;
    image->step = 3 * kPaintedWidth;
    image->encoding = "rgb8";
    image->data.assign(3 * kPaintedWidth * kPaintedHeight, kGrey);
    auto info = boost::make_shared<sensor_msgs::CameraInfo>();
    info->header = image->header;
    info->width = kPaintedWidth;
    info->height = kPaintedHeight;
    info->K = {250, 0, kPaintedWidth / 2, 0, 250, kPaintedHeight / 2, 0, 0, 1};
    info->P = {250, 0, kPaintedWidth / 2, 0, 0, 250, kPaintedHeight / 2, 0, 0, 0, 1, 0};
    OverlayJob job;
    job.image = image;
    job.info = info;
    return OverlayPainter(options, keeper_, tf_).paint(job);
  }
  /// Pixels that were drawn upon, with those of the texts.
  static std::ptrdiff_t drawn(const Overlay& overlay) {
    return std::count_if(overlay.image->data.begin(), overlay.image->data.end(),
                         [](std::uint8_t value) { return value != kGrey; });
  }

  const ::ros::Time kStamp{1060.0};
  OverlaySceneKeeper keeper_{with_band()};
  TfBuffer tf_{::ros::Duration(60.0)};
};

/// As in a recording that is looked at later: tf knows nothing of the present, and the alignment
/// was new then.
TEST_F(OverlayPainterTest, TheTimeOfTheImageCounts) {
  const Overlay overlay = painted({});
  EXPECT_EQ(overlay.status.state, OverlayStatus::DRAWN) << overlay.status.message;
  EXPECT_EQ(overlay.status.result_id, 5U);
  EXPECT_THAT(overlay.status.in_view, testing::ElementsAre("tumour"));
}

/// The band around the tumour, of some 25 pixels, is wider by the error of the camera.
TEST_F(OverlayPainterTest, TheBandIsWiderByTheErrorOfTheCamera) {
  OverlayPainterOptions options;
  const std::ptrdiff_t narrow = drawn(painted(options));
  options.camera_error_px = 20.0;
  EXPECT_GT(drawn(painted(options)), narrow + 3 * 1000);
}

}  // namespace
}  // namespace usct::ros_interface
