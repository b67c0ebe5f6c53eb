#include "rendering/overlay_contours.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

namespace usct::rendering {
namespace {

/// The rows and columns that hold all covered pixels.
cv::Rect box_of(const DepthLayer& layer) {
  int left = layer.width() + layer.margin();
  int right = -layer.margin();
  int top = layer.height() + layer.margin();
  int bottom = -layer.margin();
  for (int y = -layer.margin(); y < layer.height() + layer.margin(); ++y) {
    const Span span = layer.span(y);
    if (span.begin == span.end) continue;
    left = std::min(left, span.begin);
    right = std::max(right, span.end);
    top = std::min(top, y);
    bottom = y + 1;
  }
  return left < right ? cv::Rect(left, top, right - left, bottom - top) : cv::Rect();
}

cv::Mat covered_in(const DepthLayer& layer, const cv::Rect& box) {
  cv::Mat covered(box.size(), CV_8UC1);
  for (int y = 0; y < box.height; ++y) {
    const float* const from = layer.row(box.y + y) + box.x;
    std::uint8_t* const to = covered.ptr(y);
    for (int x = 0; x < box.width; ++x) to[x] = from[x] > 0.0F ? 255 : 0;
  }
  return covered;
}

}  // namespace

std::vector<std::vector<OutlinePixel>> outlines_of(const DepthLayer& layer) {
  const cv::Rect box = box_of(layer);
  if (box.empty()) return {};
  std::vector<std::vector<cv::Point>> curves;
  cv::findContours(covered_in(layer, box), curves, cv::RETR_LIST, cv::CHAIN_APPROX_NONE, box.tl());
  std::vector<std::vector<OutlinePixel>> outlines;
  for (const std::vector<cv::Point>& curve : curves) {
    outlines.emplace_back();
    for (const cv::Point& p : curve) {
      // At the border of the layer the surface goes on.
      const bool is_cut = p.x == -layer.margin() || p.y == -layer.margin() ||
                          p.x == layer.width() + layer.margin() - 1 ||
                          p.y == layer.height() + layer.margin() - 1;
      if (!is_cut)
        outlines.back().push_back({p.x, p.y, layer.at(p.x, p.y)});
      else if (!outlines.back().empty())
        outlines.emplace_back();
    }
  }
  return outlines;
}

void Marks::reset(int width, int height) {
  if (width != width_ || height != height_) {
    width_ = width;
    height_ = height;
    marked_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
    spans_.assign(static_cast<std::size_t>(height), {});
    return;
  }
  for (int y = 0; y < height_; ++y) {
    std::uint8_t* const to = const_cast<std::uint8_t*>(row(y));
    std::fill(to + span(y).begin, to + span(y).end, std::uint8_t{0});
    spans_[static_cast<std::size_t>(y)] = {};
  }
}

void Marks::widen(int y, int begin, int end) {
  Span& span = spans_[static_cast<std::size_t>(y)];
  span = span.begin == span.end ? Span{begin, end}
                                : Span{std::min(span.begin, begin), std::max(span.end, end)};
}

void Marks::add_dot(int x, int y, double radius_px) {
  const int reach = static_cast<int>(std::ceil(radius_px));
  const int left = std::max(0, x - reach);
  const int right = std::min(width_ - 1, x + reach);
  if (left > right) return;
  for (int v = std::max(0, y - reach); v <= std::min(height_ - 1, y + reach); ++v) {
    std::uint8_t* const to = const_cast<std::uint8_t*>(row(v));
    for (int u = left; u <= right; ++u) {
      const double distance = std::sqrt((u - x) * (u - x) + (v - y) * (v - y));
      const double inside = std::clamp(radius_px + 0.5 - distance, 0.0, 1.0);
      to[u] = std::max(to[u], static_cast<std::uint8_t>(255.0 * inside + 0.5));
    }
    widen(v, left, right + 1);
  }
}

void Marks::add_disc(int x, int y, double radius_px) {
  // Lengths are cut off well beyond the image, since those of a large bound exceed the range of
  // int.
  const double most = 2.0 * (width_ + height_);
  const int reach = static_cast<int>(std::min(radius_px, most));
  for (int v = std::max(0, y - reach); v <= std::min(height_ - 1, y + reach); ++v) {
    const int half =
        static_cast<int>(std::min(std::sqrt(radius_px * radius_px - (v - y) * (v - y)), most));
    const int begin = std::max(0, x - half);
    const int end = std::min(width_, x + half + 1);
    if (begin >= end) continue;
    std::memset(const_cast<std::uint8_t*>(row(v)) + begin, 255,
                static_cast<std::size_t>(end - begin));
    widen(v, begin, end);
  }
}

void mark_band(const std::vector<std::vector<OutlinePixel>>& outlines, const Camera& camera,
               const OverlayStructure& structure, Marks& marks) {
  // Discs at an eighth of their radius from each other cover the band but for 0.4 % of its width.
  constexpr double kStepPerRadius = 0.125;
  for (const std::vector<OutlinePixel>& outline : outlines) {
    std::size_t step = 1;
    for (std::size_t i = 0; i < outline.size(); i += step) {
      const OutlinePixel& at = outline[i];
      const double depth_mm = 1.0 / static_cast<double>(at.inverse_depth);
      const Eigen::Vector3d p_mm = depth_mm * camera.ray(Eigen::Vector2d(at.x, at.y));
      const double radius_px =
          std::hypot(*structure.bound_mm * camera.pixels_per_length(p_mm), structure.bound_px);
      marks.add_disc(at.x, at.y, radius_px);
      const double most = static_cast<double>(outline.size());
      step = static_cast<std::size_t>(std::clamp(kStepPerRadius * radius_px, 1.0, most));
    }
  }
}

}  // namespace usct::rendering
