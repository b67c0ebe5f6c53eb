#include "rendering/ct_contours.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "parallel.h"
#include "rendering/iso_lines.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::rendering {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kFatHu = -30.0;
constexpr double kBoneHu = 300.0;

/// The CT on a plane, smoothed, and the mask of its pixels.
struct CtSlice {
  cv::Mat1f hu;
  cv::Mat1b known;
};

CtSlice ct_slice(const CtVolume& ct, const Isometry3d& T_us_ct, const SlicePlane& plane,
                 double smoothing_mm) {
  CtSlice slice{cv::Mat1f(plane.height, plane.width), cv::Mat1b(plane.height, plane.width)};
  const Isometry3d T_ct_us = T_us_ct.inverse();
  parallel_for(plane.height, [&](int y) {
    for (int x = 0; x < plane.width; ++x) {
      const Vector3d index = ct.grid.index_from_physical(T_ct_us * plane.point_mm(x, y));
      slice.known(y, x) = contains_index(ct.grid, index) ? 255 : 0;
      slice.hu(y, x) = sample_at_index(ct, index, Interpolation::kTrilinear, Outside::edge());
    }
  });
  if (smoothing_mm > 0.0)
    cv::GaussianBlur(slice.hu, slice.hu, {0, 0}, smoothing_mm / plane.pixel_mm, 0.0,
                     cv::BORDER_REPLICATE);
  return slice;
}

/// Mask of pixels away from edges. Pixels between tissues have values that no tissue has.
cv::Mat1b away_from_edges(const CtSlice& slice, double pixel_mm) {
  constexpr double kSteepestHuPerMm = 8.0;
  cv::Mat1b flat(slice.hu.size(), std::uint8_t{0});
  for (int y = 1; y + 1 < flat.rows; ++y)
    for (int x = 1; x + 1 < flat.cols; ++x) {
      const double hu_per_mm = std::hypot(slice.hu(y, x + 1) - slice.hu(y, x - 1),
                                          slice.hu(y + 1, x) - slice.hu(y - 1, x)) /
                               (2.0 * pixel_mm);
      if (slice.known(y, x) != 0 && hu_per_mm < kSteepestHuPerMm) flat(y, x) = 255;
    }
  return flat;
}

void draw_segments(Picture& picture, const std::vector<Segment>& segments,
                   const Picture::Colour& colour) {
  constexpr int kShift = 4;  // sixteenths of a pixel
  cv::Mat mat(picture.height, picture.width, CV_8UC3, picture.pixels.data());
  const auto fixed = [](const cv::Point2d& p) {
    return cv::Point(static_cast<int>(std::lround(p.x * (1 << kShift))),
                     static_cast<int>(std::lround(p.y * (1 << kShift))));
  };
  for (const Segment& segment : segments)
    cv::line(mat, fixed(segment.from), fixed(segment.to),
             cv::Scalar(colour[0], colour[1], colour[2]), 1, cv::LINE_AA, kShift);
}

}  // namespace

void draw_contours(Picture& picture, const CtVolume& ct, const Isometry3d& T_us_ct,
                   const SlicePlane& plane, const RegistrationPictureOptions& options) {
  const CtSlice slice = ct_slice(ct, T_us_ct, plane, options.smoothing_mm);
  for (const ContourLevel& level : options.levels)
    draw_segments(picture,
                  iso_lines(slice.hu, slice.known, static_cast<float>(level.hu),
                            options.least_length_mm / options.pixel_mm),
                  level.colour);
}

std::vector<ContourLevel> choose_levels(const CtVolume& ct, const Isometry3d& T_us_ct,
                                        const MaskVolume& mask,
                                        const std::array<SlicePlane, 3>& planes,
                                        double smoothing_mm) {
  // Separation of uniformly distributed values; a single normal distribution has 0.64.
  constexpr double kClearSeparation = 0.75;
  constexpr double kSmallestPart = 0.03;
  std::vector<float> soft_hu;
  for (const SlicePlane& plane : planes) {
    const CtSlice slice = ct_slice(ct, T_us_ct, plane, smoothing_mm);
    const cv::Mat1b flat = away_from_edges(slice, plane.pixel_mm);
    for (int y = 0; y < plane.height; ++y)
      for (int x = 0; x < plane.width; ++x) {
        const float hu = slice.hu(y, x);
        if (flat(y, x) != 0 && hu > kFatHu && hu < kBoneHu &&
            sample(mask, plane.point_mm(x, y), Interpolation::kNearest, Outside::constant(0)) !=
                0.0F)
          soft_hu.push_back(hu);
      }
  }
  const Threshold threshold = otsu_threshold(std::move(soft_hu));
  std::vector<ContourLevel> levels{{kFatHu, "fat | soft tissue", {255, 214, 0}}};
  if (threshold.separation >= kClearSeparation && threshold.above >= kSmallestPart &&
      threshold.above <= 1.0 - kSmallestPart)
    levels.push_back({threshold.value, "soft tissue | enhanced", {0, 235, 235}});
  levels.push_back({kBoneHu, "bone, stone, vessels", {255, 90, 255}});
  return levels;
}

}  // namespace usct::rendering
