#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>

#include "core/io/expect_input_error.h"
#include "phantom/lens.h"
#include "us_ct_registration/phantom/endoscope.h"

namespace usct::phantom::test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

PhantomOptions patient_options() {
  PhantomOptions options;
  options.scene = SceneKind::kPatient;
  options.seed = 3;
  return options;
}

EndoscopeOptions small_video() {
  EndoscopeOptions options;
  options.width = 320;
  options.height = 180;
  options.frames = 3;
  options.rate_hz = 1.0;
  options.breathing_mm = 8.0;
  return options;
}

const Endoscope& endoscope() {
  static const Endoscope made(patient_options(), small_video());
  return made;
}

/// The pixel of a point of the anatomy, by OpenCV.
Vector2d projected_by_opencv(const CameraIntrinsics& camera, const Vector3d& p_camera) {
  const cv::Matx33d K(camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0);
  const std::vector<double> D(camera.distortion.begin(), camera.distortion.begin() + 5);
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(std::vector<cv::Point3d>{{p_camera.x(), p_camera.y(), p_camera.z()}},
                    cv::Vec3d(), cv::Vec3d(), K, D, pixels);
  return {pixels[0].x, pixels[0].y};
}

Vector2d centre_of(const EndoscopeImage& image) {
  Vector2d sum = Vector2d::Zero();
  double count = 0.0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      if (image.tumour[static_cast<std::size_t>(y * image.width + x)] != 0) {
        sum += Vector2d(x, y);
        ++count;
      }
  return sum / count;
}

TEST(Endoscope, LinesOfSightAreProjectedBackToTheirPixels) {
  const CameraIntrinsics& camera = endoscope().intrinsics();
  const std::vector<Eigen::Vector2f> lines = lines_of_sight(camera);
  for (int y = 0; y < camera.height; y += 7)
    for (int x = 0; x < camera.width; x += 7) {
      const Vector3d line =
          lines[static_cast<std::size_t>(y * camera.width + x)].cast<double>().homogeneous();
      EXPECT_LT((projected_by_opencv(camera, line) - Vector2d(x, y)).norm(), 0.01);
    }
}

TEST(Endoscope, DistortionThatCannotBeInvertedIsRefused) {
  CameraIntrinsics camera = endoscope().intrinsics();
  camera.distortion[0] = -1.0;
  camera.distortion[1] = 0.0;
  camera.fx = camera.fy = 0.3 * camera.width;
  usct::test::expect_input_error([&] { lines_of_sight(camera); }, {"distortion", "pixel"});
}

/// A tumour is nearly a sphere, whose centre is seen near the middle of its image. OpenCV projects
/// it; camera motion, breathing and the baseline are all in the pose.
TEST(Endoscope, TheMaskIsWhereOpenCvProjectsTheTumour) {
  const Endoscope& scope = endoscope();
  for (int frame = 0; frame < scope.options().frames; ++frame)
    for (const Eye eye : {Eye::kLeft, Eye::kRight}) {
      const Vector3d p_camera = scope.T_ct_camera(eye, frame).inverse() *
                                (scope.tumour_centre_ct_mm() + scope.shift_ct_mm(frame));
      const double px_per_mm = scope.intrinsics().fx / p_camera.z();
      const Vector2d expected = projected_by_opencv(scope.intrinsics(), p_camera);
      const double off_mm = (centre_of(scope.image(eye, frame)) - expected).norm() / px_per_mm;
      EXPECT_LT(off_mm, 0.4) << "frame " << frame;
    }
}

TEST(Endoscope, TheBaselineShiftsTheRightImage) {
  const Endoscope& scope = endoscope();
  const double depth_mm =
      (scope.T_ct_camera(Eye::kLeft, 0).inverse() * scope.tumour_centre_ct_mm()).z();
  const double disparity =
      (centre_of(scope.image(Eye::kLeft, 0)) - centre_of(scope.image(Eye::kRight, 0))).x();
  const double expected = scope.intrinsics().fx * scope.options().baseline_mm / depth_mm;
  EXPECT_NEAR(disparity, expected, 0.1 * expected);
}

TEST(Endoscope, InstrumentsHideAndTheTumourIsSeen) {
  const EndoscopeImage image = endoscope().image(Eye::kLeft, 0);
  const auto count = [](const std::vector<std::uint8_t>& mask) {
    return std::count(mask.begin(), mask.end(), 255);
  };
  EXPECT_GT(count(image.instrument), 300);
  EXPECT_GT(count(image.tumour), 300);
  EXPECT_EQ(endoscope().image(Eye::kLeft, 0).rgb, image.rgb);
}

TEST(Endoscope, BadInputIsRefused) {
  PhantomOptions without = patient_options();
  without.anatomy.tumour = false;
  usct::test::expect_input_error([&] { Endoscope(without, small_video()); }, {"no tumour"});
  PhantomOptions agar = patient_options();
  agar.scene = SceneKind::kAgar;
  usct::test::expect_input_error([&] { Endoscope(agar, small_video()); }, {"agar", "patient"});
  EndoscopeOptions wide = small_video();
  wide.field_of_view_deg = 170.0;
  usct::test::expect_input_error([&] { wide.validate(); }, {"field_of_view_deg", "170"});
  usct::test::expect_input_error([&] { endoscope().image(Eye::kLeft, 3); }, {"frame", "3"});
}

}  // namespace
}  // namespace usct::phantom::test
