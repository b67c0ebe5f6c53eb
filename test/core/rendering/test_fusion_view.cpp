#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/io/expect_input_error.h"
#include "core/rendering/cube_grid.h"
#include "rendering/panel_marks.h"
#include "us_ct_registration/rendering/fusion_view.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kViewPixelMm = 0.5;
constexpr int kViewPanelPx = 121;  // of the field, from its first voxel to its last

/// Bright where the coordinate along `axis` is above 10 mm.
ScanConverted half_bright(int axis) {
  ScanConverted us{UsVolume(cube(61), 40), MaskVolume(cube(61), 255)};
  for (int k = 0; k < 61; ++k)
    for (int j = 0; j < 61; ++j)
      for (int i = 0; i < 61; ++i)
        if (us.volume.grid.physical_from_index(Vector3d(i, j, k))[axis] > 10.0)
          us.volume.at(i, j, k) = 200;
  return us;
}

ScanConverted uniform(std::uint8_t brightness) {
  return {UsVolume(cube(61), brightness), MaskVolume(cube(61), 255)};
}

/// 100 HU per mm of depth below the surface of a ball of 12 mm about the origin.
CtVolume ball() {
  CtVolume ct(cube(81));
  for (int k = 0; k < 81; ++k)
    for (int j = 0; j < 81; ++j)
      for (int i = 0; i < 81; ++i)
        ct.at(i, j, k) = static_cast<std::int16_t>(
            100.0 * (12.0 - ct.grid.physical_from_index(Vector3d(i, j, k)).norm()));
  return ct;
}

FusionViewOptions in(FusionMode mode) {
  FusionViewOptions options;
  options.mode = mode;
  options.pictures.pixel_mm = kViewPixelMm;
  options.pictures.levels = {{0.0, "surface", {0, 255, 0}}};
  return options;
}

FusionPose pose(PoseStanding standing) {
  return {standing, Isometry3d::Identity(), "headline", "evidence"};
}

const FusionPose kNoPose{PoseStanding::kNone, std::nullopt, "there is none", ""};

/// A pixel of a panel without legend, from the panel's upper left corner.
const std::uint8_t* at(const Picture& picture, int x, int y) {
  return picture.pixel(x, picture.height - kViewPanelPx + y);
}

bool is_bright(const Picture& picture, int x, int y) { return at(picture, x, y)[0] > 200; }

/// These tell whether a panel is bright at the right, below and in the middle, away from all marks.
bool right(const Picture& picture) { return is_bright(picture, 110, 45); }
bool down(const Picture& picture) { return is_bright(picture, 50, 85); }
bool middle(const Picture& picture) { return is_bright(picture, 50, 45); }

TEST(FusionView, PlanesAreNamedByTheAxisToWhichTheyArePerpendicular) {
  const auto view = [](int axis, const FusionViewOptions& options) {
    return draw_fusion_view(half_bright(axis), nullptr, nullptr, kNoPose, options);
  };
  FusionViewOptions options = in(FusionMode::kContours);
  const FusionView lateral = view(0, options);
  EXPECT_TRUE(right(lateral.elevation) && right(lateral.axial));
  EXPECT_FALSE(down(lateral.elevation) || down(lateral.axial) || middle(lateral.lateral));
  const FusionView axial = view(1, options);
  EXPECT_TRUE(down(axial.elevation) && down(axial.lateral));
  EXPECT_FALSE(right(axial.elevation) || right(axial.lateral) || middle(axial.axial));
  const FusionView elevation = view(2, options);
  EXPECT_TRUE(right(elevation.lateral) && down(elevation.axial));
  EXPECT_FALSE(down(elevation.lateral) || right(elevation.axial) || middle(elevation.elevation));
  // All three go through the point.
  options.pictures.centre_us_mm = Vector3d(12.0, 0.0, 0.0);
  EXPECT_TRUE(middle(view(0, options).lateral));
  EXPECT_FALSE(middle(view(0, options).axial));
}

TEST(FusionView, ShowsWhatTheModeSays) {
  const CtVolume ct = ball();
  const ScanConverted us = uniform(40);
  const ScanConverted simulated = uniform(200);
  const auto panel = [&](FusionMode mode) {
    return draw_fusion_view(us, &ct, &simulated, pose(PoseStanding::kAccepted), in(mode)).axial;
  };
  const auto greens = [&](const Picture& picture) {
    int count = 0;
    for (int y = 20; y < 90; ++y)
      for (int x = 20; x < 100; ++x) {
        const std::uint8_t* pixel = at(picture, x, y);
        if (pixel[1] > pixel[0] + 60 && pixel[1] > pixel[2] + 60) ++count;
      }
    return count;
  };
  EXPECT_EQ(greens(panel(FusionMode::kUltrasound)), 0);
  EXPECT_EQ(at(panel(FusionMode::kUltrasound), 55, 55)[0], 160);  // the largest gain is 4
  // A circle of 24 px; a line of about 2 px. The legend lies below the panel.
  Picture contours = panel(FusionMode::kContours);
  contours.height -= 4 + rendering::line_px(0.55);
  EXPECT_GT(greens(contours), 100);
  const std::uint8_t* blended = at(panel(FusionMode::kBlend), 55, 55);
  EXPECT_EQ(blended[0], 255);  // CT, red
  EXPECT_EQ(blended[2], 160);  // ultrasound, blue
  // Squares of 21 px: the first is ultrasound, the one below it CT.
  const Picture squares = panel(FusionMode::kCheckerboard);
  EXPECT_EQ(at(squares, 50, 50)[0], 160);
  EXPECT_EQ(at(squares, 65, 50)[0], 255);
  EXPECT_GT(at(panel(FusionMode::kSimulated), 55, 55)[0], 250);
}

TEST(FusionView, TheColourOfTheFrameIsThatOfTheStanding) {
  const CtVolume ct = ball();
  const auto colour = [&](PoseStanding standing) {
    const FusionView view =
        draw_fusion_view(uniform(40), &ct, nullptr, pose(standing), in(FusionMode::kBlend));
    const std::uint8_t* frame = at(view.lateral, 1, 1);
    const std::uint8_t* banner = view.sheet.pixel(1, 1);
    EXPECT_TRUE(std::equal(frame, frame + 3, banner));
    return Eigen::Vector3i(frame[0], frame[1], frame[2]);
  };
  const Eigen::Vector3i accepted = colour(PoseStanding::kAccepted);
  const Eigen::Vector3i waiting = colour(PoseStanding::kWaiting);
  const Eigen::Vector3i refused = colour(PoseStanding::kRefused);
  EXPECT_GT(accepted.y(), 2 * accepted.x());
  EXPECT_GT(waiting.x(), 200);
  EXPECT_GT(waiting.y(), 100);
  EXPECT_GT(refused.x(), 200);
  EXPECT_LT(refused.y(), 50);
}

TEST(FusionView, TheBarIsAsLongAsItSays) {
  const FusionView view =
      draw_fusion_view(uniform(40), nullptr, nullptr, kNoPose, in(FusionMode::kUltrasound));
  const int y = kViewPanelPx - 2 * rendering::kMarginPx - 2;
  int white = 0;
  for (int x = 60; x < kViewPanelPx - rendering::kMarginPx; ++x)
    if (at(view.elevation, x, y)[0] == 255 && at(view.elevation, x, y)[2] == 255) ++white;
  EXPECT_EQ(white, 20);  // 10 mm, the longest that takes less than a quarter
}

TEST(FusionView, DirectionsAreThoseOfThePatient) {
  EXPECT_EQ(rendering::patient_direction({1, 0, 0}), "L");
  EXPECT_EQ(rendering::patient_direction({-1, 0, 0}), "R");
  EXPECT_EQ(rendering::patient_direction({0, 1, 0}), "P");
  EXPECT_EQ(rendering::patient_direction({0, -1, 0}), "A");
  EXPECT_EQ(rendering::patient_direction({0, 0, 1}), "H");
  EXPECT_EQ(rendering::patient_direction({0, 0, -1}), "F");
  const auto oblique = [](double degrees) {
    const double angle_rad = degrees / 57.29577951308232;
    return rendering::patient_direction({std::sin(angle_rad), 0, -std::cos(angle_rad)});
  };
  EXPECT_EQ(oblique(22.0), "F");
  EXPECT_EQ(oblique(23.0), "FL");
  EXPECT_EQ(oblique(67.0), "LF");
}

TEST(FusionView, WhatIsMissingIsSaid) {
  const CtVolume ct = ball();
  expect_input_error(
      [&] {
        draw_fusion_view(uniform(40), nullptr, nullptr, pose(PoseStanding::kAccepted),
                         in(FusionMode::kBlend));
      },
      {"no CT"});
  expect_input_error(
      [&] {
        draw_fusion_view(uniform(40), &ct, nullptr, pose(PoseStanding::kAccepted),
                         in(FusionMode::kSimulated));
      },
      {"no simulated ultrasound"});
}

/// Ultrasound that is itself simulated is fitted without error, up to the rounding of grey values.
TEST(FusionView, WhatWasSimulatedIsSimulatedAgain) {
  PreScanVolume us;
  TrackedSweep motion;
  for (int frame = 0; frame < 6; ++frame)
    motion.T_us_frame.emplace_back(Eigen::Translation3d(0.0, -20.0, 3.0 * frame - 9.0));
  us.geometry = {{50, 1.0, 0.8}, LinearArray{{-12, -8, -4, 0, 4, 8, 12}}, motion};
  std::mt19937 random(3);
  us.voxels.resize(50 * 7 * 6);
  for (std::uint8_t& voxel : us.voxels) voxel = static_cast<std::uint8_t>(60 + random() % 100);
  const PreScanVolume once = simulate_like(us, ball(), Isometry3d::Identity());
  const PreScanVolume twice = simulate_like(once, ball(), Isometry3d::Identity());
  EXPECT_NE(once.voxels, us.voxels);
  for (std::size_t i = 0; i < once.voxels.size(); ++i)
    ASSERT_NEAR(once.voxels[i], twice.voxels[i], 1.0) << i;
  expect_input_error([&] { simulate_like(us, CtVolume(cube(81), 40), Isometry3d::Identity()); },
                     {"simulated ultrasound"});
}

}  // namespace
}  // namespace usct::test
