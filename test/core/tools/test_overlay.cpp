#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "core/tools/run_usct.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

/// A cube with sides of 20 mm about (19.5, 19.5, 19.5) mm, and a camera whose optical axis meets
/// the middle of its nearest side 200 mm away.
class Overlay : public testing::Test {
 protected:
  void SetUp() override {
    Grid grid;
    grid.size = {40, 40, 40};
    LabelVolume labels(grid, 0);
    write_volume(labels, path("empty.nrrd"));
    for (int k = 10; k < 30; ++k)
      for (int j = 10; j < 30; ++j)
        for (int i = 10; i < 30; ++i) labels.at(i, j, k) = 1;
    write_volume(labels, path("labels.nrrd"));
    write_text(path("camera.yaml"),
               "image_width: 320\nimage_height: 240\ncamera_name: endoscope\n"
               "camera_matrix: {rows: 3, cols: 3, data: [600, 0, 160, 0, 600, 120, 0, 0, 1]}\n"
               "distortion_model: plumb_bob\n"
               "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
               "rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
               "projection_matrix: {rows: 3, cols: 4, data: [600, 0, 160, 0, 0, 600, 120, 0, 0, 0, "
               "1, 0]}\n");
    cv::imwrite(path("black.png"), cv::Mat::zeros(240, 320, CV_8UC3));
    write_pose(9.5 - 200.0);
  }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  void write_pose(double z_mm) const {
    write_T_us_ct(Eigen::Isometry3d(Eigen::Translation3d(19.5, 19.5, z_mm)).inverse(),
                  path("pose.tfm"));
  }

  Outcome draw(const std::string& labels) const {
    return run_usct({"overlay", "--labels", path(labels), "--camera", path("camera.yaml"), "--pose",
                     path("pose.tfm"), "--image", path("black.png"), "--output", path("out.png")});
  }

  TemporaryFolder folder_;
};

TEST_F(Overlay, ACubeCoversTheSquareThatPerspectiveGivesIt) {
  const Outcome outcome = draw("labels.nrrd");
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  const cv::Mat picture = cv::imread(path("out.png"));
  ASSERT_EQ(picture.size(), cv::Size(320, 240));
  // The nearest side, 20 mm wide 200 mm away, has 60 pixels. Its smoothed edges lie a little
  // within.
  const auto is_drawn = [&](int row, int column) {
    return picture.at<cv::Vec3b>(row, column) != cv::Vec3b(0, 0, 0);
  };
  for (const int away : {0, 15, 26}) {
    EXPECT_TRUE(is_drawn(120 - away, 160 - away)) << away;
    EXPECT_TRUE(is_drawn(120 + away, 160 + away)) << away;
  }
  for (const int away : {33, 50}) {
    EXPECT_FALSE(is_drawn(120 - away, 160 - away)) << away;
    EXPECT_FALSE(is_drawn(120 + away, 160 + away)) << away;
  }
}

TEST_F(Overlay, ACameraThatLooksAwayIsWarnedOf) {
  write_pose(100.0);  // behind the cube
  const Outcome outcome = draw("labels.nrrd");
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_NE(
      outcome.errors.find("no structure of '" + path("labels.nrrd") + "' lies in the picture"),
      std::string::npos)
      << outcome.errors;
}

TEST_F(Overlay, APictureOfAnotherSizeIsNamed) {
  cv::imwrite(path("black.png"), cv::Mat::zeros(100, 200, CV_8UC3));
  const Outcome outcome = draw("labels.nrrd");
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_NE(outcome.errors.find(path("black.png") + ": has 200 x 100 pixels"), std::string::npos)
      << outcome.errors;
}

TEST_F(Overlay, AnEmptyLabelMapIsRefused) {
  const Outcome outcome = draw("empty.nrrd");
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_NE(outcome.errors.find(path("empty.nrrd") + ": has no voxel with a label"),
            std::string::npos)
      << outcome.errors;
  EXPECT_FALSE(std::filesystem::exists(path("out.png")));
}

}  // namespace
}  // namespace usct::test
