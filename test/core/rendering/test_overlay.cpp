#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

#include "rendering/depth_layer.h"
#include "rendering/overlay_contours.h"
#include "simple_surfaces.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/rendering/overlay.h"

namespace usct {
namespace {

using rendering::DepthLayer;
using rendering::outlines_of;
using test::ball;
using test::rectangle;

Camera camera_with(const std::array<double, 8>& distortion) {
  CameraIntrinsics c;
  c.width = 640;
  c.height = 480;
  c.fx = 520.0;
  c.fy = 500.0;
  c.cx = 310.3;
  c.cy = 244.8;
  c.distortion = distortion;
  return Camera(c, "test");
}

const std::array<double, 8> kNone{};
const std::array<double, 8> kBarrel{-0.3, 0.09, 0.001, -0.002, 0.0, 0.0, 0.0, 0.0};
const std::array<double, 8> kRational{0.3, 0.05, 0.001, 0.0005, 0.02, 0.6, 0.1, 0.01};

DepthLayer drawn(const Surface& surface, const Camera& camera,
                 const Eigen::Isometry3d& T = Eigen::Isometry3d::Identity()) {
  DepthLayer layer;
  layer.reset(camera.intrinsics().width, camera.intrinsics().height, 0);
  layer.draw(surface, camera, T, OverlayRenderer::kNearestMm, OverlayRenderer::kLongestEdgePx);
  return layer;
}

OverlayStructure structure_of(const Surface& surface, const Picture::Colour& colour,
                              double opacity) {
  OverlayStructure structure;
  structure.surface = std::make_shared<const Surface>(surface);
  structure.colour = colour;
  structure.opacity = opacity;
  return structure;
}

Picture grey_picture(const Camera& camera) {
  Picture picture(camera.intrinsics().width, camera.intrinsics().height);
  std::fill(picture.pixels.begin(), picture.pixels.end(), std::uint8_t{100});
  return picture;
}

Picture::Colour colour_at(const Picture& picture, int x, int y) {
  const std::uint8_t* p = picture.pixel(x, y);
  return {p[0], p[1], p[2]};
}

/// A ray meets a ball if its angle to the direction of the centre is at most asin(R / distance).
/// The outline of the ball is therefore a known ellipse, and under distortion its image. `by_px`
/// moves the limit by as many pixels.
bool meets_ball(const Camera& camera, int x, int y, const Eigen::Vector3d& centre, double radius,
                double by_px) {
  const Eigen::Vector3d ray = camera.ray(Eigen::Vector2d(x, y));
  const double angle = std::atan2(ray.cross(centre).norm(), ray.dot(centre));
  const double limit = std::asin(radius / centre.norm());
  // A pixel subtends at most 1 / f and, with the barrel distortion in the corners, twice that.
  return angle < limit + by_px * 2.0 / 500.0;
}

TEST(DepthLayer, OfABallIsTheKnownEllipseAndDepth) {
  const Eigen::Vector3d centre(18.0, -11.0, 90.0);
  constexpr double kRadius = 15.0;
  const Surface surface = ball(centre, kRadius, 150);
  for (const auto& distortion : {kNone, kBarrel, kRational}) {
    const Camera camera = camera_with(distortion);
    const DepthLayer layer = drawn(surface, camera);
    int covered = 0;
    for (int y = 0; y < 480; ++y)
      for (int x = 0; x < 640; ++x) {
        const bool is_covered = layer.at(x, y) > 0.0F;
        covered += is_covered ? 1 : 0;
        if (meets_ball(camera, x, y, centre, kRadius, -0.3)) {
          ASSERT_TRUE(is_covered) << x << " " << y;
        }
        if (!meets_ball(camera, x, y, centre, kRadius, 0.3)) {
          ASSERT_FALSE(is_covered) << x << " " << y;
        }
        if (!meets_ball(camera, x, y, centre, kRadius, -3.0)) continue;
        // The first intersection s of the ray s r: |s r - c| = R.
        const Eigen::Vector3d r = camera.ray(Eigen::Vector2d(x, y));
        const double half = r.dot(centre) / r.squaredNorm();
        const double s = half - std::sqrt(half * half - (centre.squaredNorm() - kRadius * kRadius) /
                                                            r.squaredNorm());
        ASSERT_NEAR(1.0 / static_cast<double>(layer.at(x, y)), s, 0.05) << x << " " << y;
      }
    EXPECT_GT(covered, 10000);
  }
}

TEST(DepthLayer, OutlineOfABallRunsAlongTheEllipse) {
  const Eigen::Vector3d centre(-25.0, 15.0, 80.0);
  const Camera camera = camera_with(kBarrel);
  const auto outlines = outlines_of(drawn(ball(centre, 12.0, 150), camera));
  ASSERT_EQ(outlines.size(), 1U);
  EXPECT_GT(outlines[0].size(), 300U);
  for (const auto& at : outlines[0]) {
    EXPECT_TRUE(meets_ball(camera, at.x, at.y, centre, 12.0, 0.3));
    EXPECT_FALSE(meets_ball(camera, at.x, at.y, centre, 12.0, -1.2));
  }
}

/// Two triangles that fill most of the image have edges of hundreds of pixels, which distortion
/// bends.
TEST(DepthLayer, LongEdgesFollowTheDistortion) {
  const double half_width = 50.0;
  const double half_height = 35.0;
  const double depth = 100.0;
  for (const auto& distortion : {kBarrel, kRational}) {
    const Camera camera = camera_with(distortion);
    const DepthLayer layer = drawn(rectangle(half_width, half_height, depth), camera);
    int near_border = 0;
    for (int y = 0; y < 480; ++y)
      for (int x = 0; x < 640; ++x) {
        const Eigen::Vector3d p = depth * camera.ray(Eigen::Vector2d(x, y));
        const double inside_mm =
            std::min(half_width - std::abs(p.x()), half_height - std::abs(p.y()));
        // A pixel is at most 0.4 mm there.
        constexpr double kTenthOfAPixelMm = 0.04;
        if (inside_mm > kTenthOfAPixelMm) {
          ASSERT_GT(layer.at(x, y), 0.0F) << x << " " << y;
        }
        if (inside_mm < -kTenthOfAPixelMm) {
          ASSERT_EQ(layer.at(x, y), 0.0F) << x << " " << y;
        }
        near_border += std::abs(inside_mm) < 0.4 ? 1 : 0;
      }
    EXPECT_GT(near_border, 1000);
  }
}

/// The images of a camera and of another one, a baseline b to its right, differ by f b / z.
TEST(DepthLayer, StereoDiffersByTheDisparity) {
  const Camera camera = camera_with(kNone);
  const double baseline = 5.0;
  const double depth = 80.0;
  Eigen::Isometry3d T_right_left = Eigen::Isometry3d::Identity();
  T_right_left.translation().x() = -baseline;
  const Surface surface = rectangle(8.0, 6.0, depth);
  const auto mean_x = [](const DepthLayer& layer) {
    double sum = 0.0;
    double count = 0.0;
    for (int y = 0; y < 480; ++y)
      for (int x = 0; x < 640; ++x)
        if (layer.at(x, y) > 0.0F) {
          sum += x;
          count += 1.0;
        }
    return sum / count;
  };
  EXPECT_NEAR(mean_x(drawn(surface, camera)) - mean_x(drawn(surface, camera, T_right_left)),
              520.0 * baseline / depth, 0.5);
}

TEST(DepthLayer, NothingBehindTheCameraAppears) {
  const Camera camera = camera_with(kBarrel);
  const auto covered = [&](const Surface& surface) {
    const DepthLayer layer = drawn(surface, camera);
    int count = 0;
    for (int y = 0; y < 480; ++y)
      for (int x = 0; x < 640; ++x) count += layer.at(x, y) > 0.0F ? 1 : 0;
    return count;
  };
  EXPECT_EQ(covered(ball({0.0, 0.0, -80.0}, 15.0, 40)), 0);
  // A ball around the camera: all of its triangles face away.
  EXPECT_EQ(covered(ball({0.0, 0.0, 0.0}, 30.0, 40)), 0);
  // A ball beside the camera, partly behind it, is out of view.
  EXPECT_EQ(covered(ball({60.0, 0.0, 5.0}, 15.0, 40)), 0);
  Surface broken = ball({0.0, 0.0, 80.0}, 15.0, 10);
  for (Eigen::Vector3d& p : broken.points_mm) p.x() = std::nan("");
  EXPECT_EQ(covered(broken), 0);
}

TEST(Overlay, FillIsFainterTheDeeperItLies) {
  const Camera camera = camera_with(kNone);
  OverlayOptions options;
  options.hidden_depth_mm = 20.0;
  OverlayRenderer renderer(options);
  Picture picture = grey_picture(camera);
  // The second rectangle is 10 mm behind the first: its weight is 0.9 * 20 / (20 + 10) = 0.6.
  const auto coverage =
      renderer.draw(view_of(picture), camera, Eigen::Isometry3d::Identity(),
                    {structure_of(rectangle(20.0, 20.0, 100.0), {0, 0, 0}, 0.0),
                     structure_of(rectangle(10.0, 10.0, 110.0), {200, 0, 100}, 0.9)});
  EXPECT_NEAR(coverage[0], 208.0 * 200.0, 450.0);
  const Picture::Colour middle = colour_at(picture, 310, 245);
  EXPECT_NEAR(middle[0], 0.4 * 100 + 0.6 * 200, 2);
  EXPECT_NEAR(middle[1], 0.4 * 100, 2);
  EXPECT_NEAR(middle[2], 100, 2);
  EXPECT_EQ(colour_at(picture, 310 + 75, 245), Picture::Colour(100, 100, 100));
}

/// The outline of what is hidden has gaps; that of what lies before it has none.
TEST(Overlay, OutlinesOfWhatIsHiddenAreDashed) {
  const Camera camera = camera_with(kNone);
  const auto drawn_along_top = [&](double depth_of_other) {
    OverlayRenderer renderer;
    Picture picture = grey_picture(camera);
    renderer.draw(view_of(picture), camera, Eigen::Isometry3d::Identity(),
                  {structure_of(rectangle(40.0, 40.0, depth_of_other), {0, 0, 0}, 0.0),
                   structure_of(rectangle(20.0, 20.0, 100.0), {255, 255, 255}, 0.0)});
    int along = 0;
    for (int x = 215; x < 405; ++x) {
      bool is_drawn = false;
      for (int y = 143; y <= 147; ++y) is_drawn = is_drawn || colour_at(picture, x, y)[0] > 200;
      along += is_drawn ? 1 : 0;
    }
    return along;
  };
  EXPECT_EQ(drawn_along_top(150.0), 190);
  EXPECT_GT(drawn_along_top(95.0), 60);
  EXPECT_LT(drawn_along_top(95.0), 150);
}

/// Whatever the direction of an error that is within the bound, the outline stays in the band.
TEST(Overlay, TheBandHoldsTheOutlineOfWhatIsDisplacedByTheBound) {
  const Eigen::Vector3d centre(14.0, 9.0, 85.0);
  const double bound_mm = 3.0;
  const Surface surface = ball(centre, 11.0, 100);
  const Camera camera = camera_with(kBarrel);
  OverlayStructure structure = structure_of(surface, {255, 255, 255}, 0.0);
  structure.bound_mm = bound_mm;
  rendering::Marks marks;
  marks.reset(640, 480);
  rendering::mark_band(outlines_of(drawn(surface, camera)), camera, structure, marks);
  const auto share_in_band = [&](double error_mm, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    int in_band = 0;
    int all = 0;
    for (int i = 0; i < 40; ++i) {
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      T.translation() =
          error_mm * Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
      for (const auto& outline : outlines_of(drawn(surface, camera, T)))
        for (const auto& at : outline) {
          ++all;
          in_band += marks.row(at.y)[at.x] != 0 ? 1 : 0;
        }
    }
    return static_cast<double>(in_band) / all;
  };
  EXPECT_GT(share_in_band(0.97 * bound_mm, 1), 0.9995);
  EXPECT_LT(share_in_band(2.0 * bound_mm, 2), 0.8);
}

TEST(Overlay, TheBandOfWhatLiesBesideTheImageReachesIntoIt) {
  const Camera camera = camera_with(kNone);
  // The right edge is at column 310.3 - 520 * 62 / 100, 12 pixels beside the image; the band is 31
  // pixels wide.
  Surface beside = rectangle(10.0, 10.0, 100.0);
  for (Eigen::Vector3d& p : beside.points_mm) p.x() -= 72.0;
  OverlayStructure structure = structure_of(beside, {0, 255, 0}, 0.5);
  structure.bound_mm = 5.0;
  Picture picture = grey_picture(camera);
  OverlayRenderer renderer;
  const auto coverage =
      renderer.draw(view_of(picture), camera, Eigen::Isometry3d::Identity(), {structure});
  EXPECT_EQ(coverage[0], 0U);
  EXPECT_NE(colour_at(picture, 5, 245), Picture::Colour(100, 100, 100));
  EXPECT_EQ(colour_at(picture, 30, 245), Picture::Colour(100, 100, 100));
}

TEST(Overlay, OneImageLeavesNothingInTheNext) {
  const Camera camera = camera_with(kBarrel);
  OverlayStructure first = structure_of(ball({5.0, 0.0, 60.0}, 20.0, 40), {255, 0, 0}, 0.5);
  first.bound_mm = 4.0;
  const OverlayStructure second =
      structure_of(ball({-20.0, 5.0, 90.0}, 10.0, 40), {0, 255, 0}, 0.5);
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Picture ignored = grey_picture(camera);
  Picture after = grey_picture(camera);
  Picture alone = grey_picture(camera);
  OverlayRenderer used;
  used.draw(view_of(ignored), camera, T, {first, second});
  used.draw(view_of(after), camera, T, {second});
  OverlayRenderer().draw(view_of(alone), camera, T, {second});
  EXPECT_EQ(after.pixels, alone.pixels);
  EXPECT_NE(ignored.pixels, alone.pixels);
}

TEST(Overlay, ChannelsOfBgrImagesAreSwapped) {
  const Camera camera = camera_with(kNone);
  const auto structure = structure_of(rectangle(20.0, 20.0, 100.0), {250, 20, 0}, 1.0);
  for (const bool is_bgr : {false, true}) {
    Picture picture = grey_picture(camera);
    ImageView view = view_of(picture);
    view.is_bgr = is_bgr;
    OverlayRenderer().draw(view, camera, Eigen::Isometry3d::Identity(), {structure});
    const Picture::Colour expected =
        is_bgr ? Picture::Colour(0, 20, 250) : Picture::Colour(250, 20, 0);
    EXPECT_EQ(colour_at(picture, 310, 245), expected);
  }
}

TEST(Overlay, WhatIsNotInViewLeavesTheImageAsItIs) {
  const Camera camera = camera_with(kBarrel);
  Picture picture = grey_picture(camera);
  const Picture before = picture;
  OverlayRenderer renderer;
  const auto coverage =
      renderer.draw(view_of(picture), camera, Eigen::Isometry3d::Identity(),
                    {structure_of({}, {255, 0, 0}, 1.0),
                     structure_of(ball({0.0, 0.0, -50.0}, 10.0, 20), {255, 0, 0}, 1.0)});
  EXPECT_EQ(coverage, (OverlayCoverage{0, 0}));
  EXPECT_EQ(picture.pixels, before.pixels);
}

TEST(Overlay, AnImageOfAnotherSizeIsRefused) {
  const Camera camera = camera_with(kNone);
  Picture small(320, 240);
  OverlayRenderer renderer;
  EXPECT_THROW(renderer.draw(view_of(small), camera, Eigen::Isometry3d::Identity(), {}),
               InputError);
  OverlayOptions options;
  options.outline_px = 0.0;
  EXPECT_THROW(OverlayRenderer{options}, InputError);
}

TEST(Overlay, TextIsWrittenOnADarkStripAndOnlyThere) {
  Picture picture(640, 480);
  std::fill(picture.pixels.begin(), picture.pixels.end(), std::uint8_t{100});
  draw_line(view_of(picture), "NO OVERLAY", 0, {255, 0, 0});
  int red = 0;
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 200; ++x) red += colour_at(picture, x, y)[0] > 150 ? 1 : 0;
  EXPECT_GT(red, 50);
  EXPECT_EQ(colour_at(picture, 320, 240), Picture::Colour(100, 100, 100));
  draw_line(view_of(picture), "far below", 1000, {255, 0, 0});
}

}  // namespace
}  // namespace usct
