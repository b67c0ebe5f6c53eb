#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/rendering/slices.h"

namespace usct {
namespace {

Grid cube(int size) {
  Grid grid;
  grid.size.setConstant(size);
  grid.origin_mm.setConstant(-0.5 * (size - 1));
  return grid;
}

/// One voxel differs from all others, and the pictures must show it at its position.
TEST(Slices, ACtVoxelIsDrawnWhereTheTransformPutsIt) {
  CtVolume ct(cube(21), -160);
  ct.at(15, 10, 10) = 340;  // at (5, 0, 0) mm in the CT
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  T_us_ct.linear() =  // x to y: the voxel comes to lie at (0, 5, 0) + (2, 0, 0)
      Eigen::AngleAxisd(0.5 * kPi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T_us_ct.translation() = Eigen::Vector3d(2, 0, 0);
  const auto planes = orthogonal_planes(cube(21), Eigen::Vector3d::Zero(), 1.0);
  const Picture picture = render_ct(ct, T_us_ct, {}, planes[0]);  // x right, y down
  ASSERT_EQ(picture.width, 21);
  ASSERT_EQ(picture.height, 21);
  EXPECT_GT(int{picture.pixel(12, 15)[0]}, 250);
  EXPECT_LT(int{picture.pixel(13, 15)[0]}, 5);
  EXPECT_LT(int{picture.pixel(12, 14)[0]}, 5);
}

TEST(Slices, OutsideTheMaskOrTheCtIsNeverGrey) {
  const UsVolume us(cube(21), 200);
  MaskVolume mask(cube(21), 255);
  mask.at(20, 20, 10) = 0;
  const auto planes = orthogonal_planes(cube(41), Eigen::Vector3d::Zero(), 1.0);
  const Picture picture = render_us(us, mask, planes[0]);
  const auto is_grey = [&](int x, int y) {
    return picture.pixel(x, y)[0] == picture.pixel(x, y)[2];
  };
  EXPECT_TRUE(is_grey(20, 20));
  EXPECT_FALSE(is_grey(30, 30));  // masked
  EXPECT_FALSE(is_grey(5, 38));   // beyond the volume
}

TEST(Slices, CheckerboardAlternates) {
  Picture us(4, 4);
  Picture ct(4, 4);
  std::fill(ct.pixels.begin(), ct.pixels.end(), std::uint8_t{255});
  const Picture board = checkerboard(us, ct, 2);
  EXPECT_EQ(int{board.pixel(0, 0)[0]}, 0);
  EXPECT_EQ(int{board.pixel(2, 1)[0]}, 255);
  EXPECT_EQ(int{board.pixel(1, 2)[0]}, 255);
  EXPECT_EQ(int{board.pixel(3, 3)[0]}, 0);
  EXPECT_THROW(checkerboard(us, Picture(3, 4), 2), InputError);
  EXPECT_THROW(checkerboard(us, ct, 0), InputError);
}

TEST(Slices, CheckerboardLeavesNoStripOver) {
  Picture ct(5, 1);
  std::fill(ct.pixels.begin(), ct.pixels.end(), std::uint8_t{255});
  const Picture board = checkerboard(Picture(5, 1), ct, 2);
  EXPECT_EQ(int{board.pixel(2, 0)[0]}, 0);
  EXPECT_EQ(int{board.pixel(4, 0)[0]}, 255);
}

TEST(WritePng, KeepsColoursAndRefusesOtherNames) {
  const auto folder = std::filesystem::temp_directory_path() / "usct_test_write_png";
  std::filesystem::create_directories(folder);
  Picture picture(2, 1);
  picture.pixels = {255, 10, 20, 30, 40, 50};
  write_png(picture, folder / "p.png");
  const cv::Mat bgr = cv::imread((folder / "p.png").string());
  EXPECT_EQ(bgr.at<cv::Vec3b>(0, 0), cv::Vec3b(20, 10, 255));
  EXPECT_EQ(bgr.at<cv::Vec3b>(0, 1), cv::Vec3b(50, 40, 30));
  EXPECT_THROW(write_png(picture, folder / "p.jpg"), InputError);
  EXPECT_THROW(write_png(picture, folder / "absent" / "p.png"), InputError);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace usct
