#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "core/rendering/cube_grid.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/rendering/registration_pictures.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr int kFieldMm = 61;
constexpr double kPixelMm = 0.5;
constexpr int kPanelPx = 121;  // from the first voxel of the field to its last
constexpr int kHeaderPx = 52;  // a line of text and the legend
constexpr int kGapPx = 4;
constexpr double kRadiusMm = 12.0;

/// 100 HU per mm of depth below the surface of a ball about `centre_mm`: 0 HU is the surface.
CtVolume ball(const Grid& grid, const Vector3d& centre_mm) {
  CtVolume ct(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        ct.at(i, j, k) = static_cast<std::int16_t>(std::lround(
            100.0 *
            (kRadiusMm - (grid.physical_from_index(Vector3d(i, j, k)) - centre_mm).norm())));
  return ct;
}

ScanConverted dark_field() {
  return {UsVolume(cube(kFieldMm), 40), MaskVolume(cube(kFieldMm), 255)};
}

/// One green line at 0 HU; nothing else in a picture is green.
RegistrationPictureOptions green_line() {
  RegistrationPictureOptions options;
  options.pixel_mm = kPixelMm;
  options.levels = {{0.0, "surface", {0, 255, 0}}};
  return options;
}

bool is_green(const std::uint8_t* pixel) { return pixel[1] > pixel[0] + 60; }
bool is_red(const std::uint8_t* pixel) { return pixel[0] > pixel[1] + 120; }

/// A panel of a sheet with three rows of panels, which are all equally large.
struct Panel {
  int row;
  int column;
};

/// Positions, in mm from the panel's middle, of its pixels for which `test` is true.
template <typename Test>
std::vector<Eigen::Vector2d> positions_mm(const Picture& sheet, Panel panel, const Test& test) {
  const int left = panel.column * (kPanelPx + kGapPx);
  const int top = sheet.height + kGapPx - (3 - panel.row) * (kPanelPx + kGapPx);
  std::vector<Eigen::Vector2d> positions;
  for (int y = 0; y < kPanelPx; ++y)
    for (int x = 0; x < kPanelPx; ++x)
      if (test(sheet.pixel(left + x, top + y)))
        positions.push_back(Eigen::Vector2d(x - 0.5 * (kPanelPx - 1), y - 0.5 * (kPanelPx - 1)) *
                            kPixelMm);
  return positions;
}

/// Expects all positions on the circle, in all directions.
void expect_circle(const std::vector<Eigen::Vector2d>& positions_mm,
                   const Eigen::Vector2d& centre_mm, double radius_mm) {
  std::vector<int> sectors(36, 0);
  for (const Eigen::Vector2d& position : positions_mm) {
    const Eigen::Vector2d from_centre = position - centre_mm;
    EXPECT_NEAR(from_centre.norm(), radius_mm, 1.6 * kPixelMm);
    const double turn = std::atan2(from_centre.y(), from_centre.x()) / (2.0 * kPi) + 0.5;
    ++sectors[static_cast<std::size_t>(36.0 * turn) % 36];
  }
  EXPECT_EQ(std::count(sectors.begin(), sectors.end(), 0), 0);
}

RegistrationResult registered(const Isometry3d& T_us_ct) {
  RegistrationResult result;
  result.status = RegistrationStatus::kRegistered;
  result.T_us_ct = T_us_ct;
  return result;
}

/// One of two poses that move the ball's middle from (30, -20, 100) in the CT to `centre_us_mm`.
Isometry3d pose_of_ball(const Vector3d& centre_us_mm, double angle_rad) {
  return Eigen::Translation3d(centre_us_mm) *
         Eigen::AngleAxisd(angle_rad, Vector3d(1, 2, -1).normalized()) *
         Eigen::Translation3d(-30, 20, -100);
}

CtVolume ball_in_ct() {
  Grid grid = cube(81, 0.8);
  grid.origin_mm += Vector3d(30, -20, 100);
  return ball(grid, {30, -20, 100});
}

TEST(RegistrationPictures, ContoursLieWhereEachPosePutsThem) {
  RegistrationPictureOptions options = green_line();
  options.centre_us_mm = Vector3d(0, 0, 0);
  const Vector3d before(5, -3, 4);
  const Vector3d after(-6, 2, -5);
  const Picture sheet = picture_registration(dark_field(), ball_in_ct(), pose_of_ball(before, 0.7),
                                             registered(pose_of_ball(after, -1.1)), options);
  ASSERT_EQ(sheet.width, 3 * kPanelPx + 2 * kGapPx);
  ASSERT_EQ(sheet.height, kHeaderPx + 3 * (kPanelPx + kGapPx));
  const int axes[3][3] = {{0, 1, 2}, {2, 1, 0}, {0, 2, 1}};  // right, down, normal of the columns
  for (int column = 0; column < 3; ++column) {
    SCOPED_TRACE(column);
    EXPECT_TRUE(positions_mm(sheet, {0, column}, is_green).empty());
    for (const auto& [row, centre] : {std::pair(1, before), std::pair(2, after)}) {
      SCOPED_TRACE(row);
      const auto& [right, down, normal] = axes[column];
      expect_circle(positions_mm(sheet, {row, column}, is_green), {centre[right], centre[down]},
                    std::sqrt(kRadiusMm * kRadiusMm - centre[normal] * centre[normal]));
    }
  }
}

TEST(RegistrationPictures, PlanesMeetInTheMiddleOfTheField) {
  ScanConverted us = dark_field();
  for (int k = 0; k < 50; ++k)  // known from 20 to 30 mm along z only: the middle is at 25
    for (int j = 0; j < kFieldMm; ++j)
      for (int i = 0; i < kFieldMm; ++i) us.mask.at(i, j, k) = 0;
  const Picture sheet =
      picture_registration(us, ball_in_ct(), Isometry3d::Identity(),
                           registered(pose_of_ball({0, 0, 25}, 0.0)), green_line());
  expect_circle(positions_mm(sheet, {2, 0}, is_green), {0, 0}, kRadiusMm);
}

TEST(RegistrationPictures, AxesTurnThePlanes) {
  RegistrationPictureOptions options = green_line();
  options.axes_us = Eigen::AngleAxisd(0.5 * kPi, Vector3d::UnitZ()).matrix();  // right is US y
  const Vector3d after(-6, 3, 0);
  const Picture sheet = picture_registration(dark_field(), ball_in_ct(), Isometry3d::Identity(),
                                             registered(pose_of_ball(after, 0.3)), options);
  expect_circle(positions_mm(sheet, {2, 0}, is_green), {after.y(), -after.x()}, kRadiusMm);
}

TEST(RegistrationPictures, NothingIsDrawnOutsideTheCt) {
  Grid small = cube(31, 0.8);  // ends at x = 0.4: cuts the ball in half
  small.origin_mm.x() = -24.0 + 0.4;
  const Picture sheet =
      picture_registration(dark_field(), ball(small, {0, 0, 0}), Isometry3d::Identity(),
                           registered(Isometry3d::Identity()), green_line());
  const auto positions = positions_mm(sheet, {2, 0}, is_green);
  EXPECT_GT(positions.size(), 40U);
  for (const Eigen::Vector2d& position : positions) {
    EXPECT_LT(position.x(), 0.8 + kPixelMm);
    EXPECT_GT(position.norm(), kRadiusMm - 1.6 * kPixelMm);  // no line along the cut either
  }
}

TEST(RegistrationPictures, ARefusedResultIsMarkedAndItsBestCandidateDrawn) {
  RegistrationResult result;
  result.status = RegistrationStatus::kLowConfidence;
  result.message = "two optima are alike";
  result.candidates = {{pose_of_ball({4, 0, 0}, 0.2), 0.4, 0.9},
                       {pose_of_ball({-9, 0, 0}, 0.2), 0.3, 0.9}};
  const Picture sheet = picture_registration(dark_field(), ball_in_ct(),
                                             pose_of_ball({0, 0, 0}, 0.0), result, green_line());
  EXPECT_TRUE(is_red(sheet.pixel(sheet.width - 2, 1)));
  expect_circle(positions_mm(sheet, {2, 0}, is_green), {4, 0}, kRadiusMm);
  for (int column = 0; column < 3; ++column) {
    EXPECT_GE(positions_mm(sheet, {2, column}, is_red).size(), 4U * (kPanelPx - 1));
    EXPECT_TRUE(positions_mm(sheet, {1, column}, is_red).empty());  // the start is not refused
  }
  for (const Picture& other :
       {picture_fusion(dark_field(), ball_in_ct(), result, green_line()),
        picture_parallel_slices(dark_field(), ball_in_ct(), result, green_line())}) {
    EXPECT_TRUE(is_red(other.pixel(other.width - 2, 1)));
    for (int row = 0; row < 3; ++row)
      EXPECT_GE(positions_mm(other, {row, 0}, is_red).size(), 4U * (kPanelPx - 1));
  }

  const Picture good =
      picture_registration(dark_field(), ball_in_ct(), pose_of_ball({0, 0, 0}, 0.0),
                           registered(pose_of_ball({4, 0, 0}, 0.2)), green_line());
  EXPECT_FALSE(is_red(good.pixel(good.width - 2, 1)));
  EXPECT_TRUE(positions_mm(good, {2, 0}, is_red).empty());
}

TEST(RegistrationPictures, ParallelSlicesShrinkTheCircleAwayFromTheMiddle) {
  const Picture sheet = picture_parallel_slices(
      dark_field(), ball_in_ct(), registered(pose_of_ball({0, 0, 0}, 0.4)), green_line());
  // At 20, 35, 50, 65 and 80 % of 60 mm: 18, 9, 0, -9, -18 mm from the middle.
  const double radius_at_9 = std::sqrt(kRadiusMm * kRadiusMm - 81.0);
  for (int row = 0; row < 3; ++row) {
    SCOPED_TRACE(row);
    EXPECT_TRUE(positions_mm(sheet, {row, 0}, is_green).empty());
    expect_circle(positions_mm(sheet, {row, 1}, is_green), {0, 0}, radius_at_9);
    expect_circle(positions_mm(sheet, {row, 2}, is_green), {0, 0}, kRadiusMm);
    expect_circle(positions_mm(sheet, {row, 3}, is_green), {0, 0}, radius_at_9);
    EXPECT_TRUE(positions_mm(sheet, {row, 4}, is_green).empty());
  }
}

TEST(RegistrationPictures, ShortLinesAreNoiseAndNotDrawn) {
  CtVolume ct(cube(81), -100);
  ct.at(40, 40, 40) = 3000;
  RegistrationPictureOptions options = green_line();
  const auto green = [&] {
    const Picture sheet = picture_registration(dark_field(), ct, Isometry3d::Identity(),
                                               registered(Isometry3d::Identity()), options);
    return positions_mm(sheet, {2, 0}, is_green).size();
  };
  EXPECT_EQ(green(), 0U);
  options.least_length_mm = 2.0;
  EXPECT_GT(green(), 5U);
}

/// Colours in the legend of automatic levels.
bool has_cyan(const Picture& sheet) {
  for (int y = 24; y < kHeaderPx; ++y)
    for (int x = 0; x < sheet.width; ++x)
      if (sheet.pixel(x, y)[1] > 200 && sheet.pixel(x, y)[0] < 60) return true;
  return false;
}

TEST(RegistrationPictures, AnEnhancedKidneyHasALevelOfItsOwn) {
  CtVolume ct(cube(81), 40);
  RegistrationPictureOptions options;
  options.pixel_mm = 0.25;  // room for the legend
  const auto sheet = [&] {
    return picture_registration(dark_field(), ct, Isometry3d::Identity(),
                                registered(Isometry3d::Identity()), options);
  };
  for (std::size_t i = 0; i < ct.voxels.size(); ++i)  // even noise
    ct.voxels[i] = static_cast<std::int16_t>(30 + (7919 * i) % 21);
  EXPECT_FALSE(has_cyan(sheet()));
  for (int k = 0; k < 81; ++k)
    for (int j = 0; j < 81; ++j)
      for (int i = 0; i < 40; ++i) ct.at(i, j, k) = static_cast<std::int16_t>(ct.at(i, j, k) + 110);
  EXPECT_TRUE(has_cyan(sheet()));
}

TEST(RegistrationPictures, AreWrittenIntoANewFolder) {
  const TemporaryFolder folder;
  const auto paths = write_registration_pictures(
      dark_field(), ball_in_ct(), pose_of_ball({0, 0, 0}, 0.0),
      registered(pose_of_ball({1, 0, 0}, 0.0)), folder.path() / "new" / "pictures", green_line());
  ASSERT_EQ(paths.size(), 3U);
  for (const auto& path : paths) EXPECT_FALSE(cv::imread(path.string()).empty()) << path;

  // No picture of the earlier registration stays beside that of one that found nothing.
  RegistrationResult nothing;
  const auto only =
      write_registration_pictures(dark_field(), ball_in_ct(), pose_of_ball({0, 0, 0}, 0.0), nothing,
                                  folder.path() / "new" / "pictures", green_line());
  ASSERT_EQ(only.size(), 1U);
  for (const auto& path : paths) EXPECT_EQ(std::filesystem::exists(path), path == only[0]) << path;
  const cv::Mat sheet = cv::imread(only[0].string());
  EXPECT_EQ(sheet.rows, kHeaderPx + 2 * (kPanelPx + kGapPx));
}

TEST(RegistrationPictures, RefuseWhatIsNoInput) {
  const auto refuse = [](const RegistrationPictureOptions& options, const std::string& field) {
    expect_input_error(
        [&] {
          picture_registration(dark_field(), ball_in_ct(), Isometry3d::Identity(),
                               registered(Isometry3d::Identity()), options);
        },
        {field});
  };
  RegistrationPictureOptions options = green_line();
  options.pixel_mm = 0.0;
  refuse(options, "pixel_mm");
  options = green_line();
  options.smoothing_mm = -1.0;
  refuse(options, "smoothing_mm");
  options = green_line();
  options.window = {100.0, 100.0};
  refuse(options, "window");
  options = green_line();
  options.axes_us(0, 0) = -1.0;
  refuse(options, "axes_us");
  options = green_line();
  options.levels[0].hu = NAN;
  refuse(options, "levels.hu");
  expect_input_error(
      [] { picture_fusion(dark_field(), ball_in_ct(), RegistrationResult(), green_line()); },
      {"result", "neither"});
  ScanConverted blind = dark_field();
  std::fill(blind.mask.voxels.begin(), blind.mask.voxels.end(), std::uint8_t{0});
  expect_input_error(
      [&] {
        picture_registration(blind, ball_in_ct(), Isometry3d::Identity(),
                             registered(Isometry3d::Identity()), green_line());
      },
      {"mask"});
}

TEST(PictureAxes, AreThoseOfTheMiddleFrameOfATrackedSweep) {
  PreScanVolume prescan;
  prescan.geometry.motion = MotorSweep{27.25, {-0.1, 0.1}, 0.0};
  EXPECT_EQ(picture_axes(prescan), Eigen::Matrix3d::Identity());
  TrackedSweep sweep;
  for (const double angle : {0.1, 0.2, 0.3})
    sweep.T_us_frame.emplace_back(Eigen::AngleAxisd(angle, Vector3d::UnitX()));
  prescan.geometry.motion = sweep;
  EXPECT_TRUE(picture_axes(prescan).isApprox(
      Eigen::AngleAxisd(0.2, Vector3d::UnitX()).toRotationMatrix(), 1e-12));
  TrackedImages images;
  Eigen::Affine3d T_us_pixel = Eigen::Affine3d::Identity();
  T_us_pixel.linear().col(0) = Vector3d(0, 0.3, 0);
  T_us_pixel.linear().col(1) = Vector3d(0, 0.001, 0.2);
  images.T_us_pixel = {T_us_pixel};
  Eigen::Matrix3d expected;
  expected << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  EXPECT_TRUE(picture_axes(images).isApprox(expected, 1e-12));
  EXPECT_EQ(picture_axes(UsVolume(cube(3))), Eigen::Matrix3d::Identity());
}

}  // namespace
}  // namespace usct::test
