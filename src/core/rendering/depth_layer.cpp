#include "rendering/depth_layer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

namespace usct::rendering {

using Eigen::Vector2f;
using Eigen::Vector3f;

namespace {

// By conversion: without SSE4.1, which the compiler may not assume, std::floor takes a call.
int floor_of(float value) {
  const int towards_zero = static_cast<int>(value);
  return towards_zero - (static_cast<float>(towards_zero) > value ? 1 : 0);
}
int ceil_of(float value) {
  const int towards_zero = static_cast<int>(value);
  return towards_zero + (static_cast<float>(towards_zero) < value ? 1 : 0);
}

}  // namespace

void DepthLayer::reset(int width, int height, int margin) {
  if (width != width_ || height != height_ || margin != margin_) {
    width_ = width;
    height_ = height;
    margin_ = margin;
    columns_ = width + 2 * margin;
    const auto rows = static_cast<std::size_t>(height + 2 * margin);
    inverse_depth_.assign(rows * static_cast<std::size_t>(columns_), 0.0F);
    spans_.assign(rows, {});
    return;
  }
  for (int y = -margin_; y < height_ + margin_; ++y) {
    const Span used = span(y);
    std::fill(writable_row(y) + used.begin, writable_row(y) + used.end, 0.0F);
    spans_[static_cast<std::size_t>(y + margin_)] = {};
  }
}

DepthLayer::Corner DepthLayer::corner_of(const Vector3f& p, const Camera& camera) const {
  const float inverse = 1.0F / p.z();
  return {camera.project_normalised({p.x() * inverse, p.y() * inverse}), inverse};
}

void DepthLayer::project(const Surface& surface, const Camera& camera,
                         const Eigen::Isometry3d& T_camera_surface, double nearest_mm) {
  const std::size_t count = surface.points_mm.size();
  points_mm_.resize(count);
  corners_.resize(count);
  const Eigen::Matrix3d turn = T_camera_surface.linear();
  const Eigen::Vector3d shift = T_camera_surface.translation();
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d p_mm = turn * surface.points_mm[i] + shift;
    points_mm_[i] = p_mm.cast<float>();
    // The comparison is false for NaN as well.
    corners_[i] =
        p_mm.z() >= nearest_mm ? corner_of(points_mm_[i], camera) : Corner{Vector2f::Zero(), 0.0F};
  }
}

DepthLayer::Box DepthLayer::box_of(const Corner (&corner)[3]) {
  const Vector2f &a = corner[0].pixel, &b = corner[1].pixel, &c = corner[2].pixel;
  return {a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c)};
}

bool DepthLayer::is_beside_image(const Box& box) const {
  const auto margin = static_cast<float>(margin_);
  return !(box.most.x() >= -margin && box.least.x() < static_cast<float>(width_ + margin_) &&
           box.most.y() >= -margin && box.least.y() < static_cast<float>(height_ + margin_));
}

void DepthLayer::draw(const Surface& surface, const Camera& camera,
                      const Eigen::Isometry3d& T_camera_surface, double nearest_mm,
                      double longest_edge_px) {
  project(surface, camera, T_camera_surface, nearest_mm);
  // No edge in a square of this side is longer than the limit.
  const auto short_side = static_cast<float>(longest_edge_px / std::sqrt(2.0));
  for (const auto& [i, j, k] : surface.triangles) {
    const Corner corner[3] = {corners_[i], corners_[j], corners_[k]};
    if (corner[0].inverse_depth == 0.0F || corner[1].inverse_depth == 0.0F ||
        corner[2].inverse_depth == 0.0F)
      continue;
    const Box box = box_of(corner);
    if (is_beside_image(box)) continue;
    if (camera.is_distorted() && (box.most - box.least).maxCoeff() > short_side) {
      const Vector3f p[3] = {points_mm_[i], points_mm_[j], points_mm_[k]};
      divide(camera, p, corner, static_cast<float>(longest_edge_px));
    } else {
      fill(corner[0], corner[1], corner[2]);
    }
  }
}

/// Halves the longest edge until all are short. Whether an edge is halved depends on the edge
/// alone, so that neighbours halve it alike and no gap opens between them.
void DepthLayer::divide(const Camera& camera, const Vector3f (&p)[3], const Corner (&corner)[3],
                        float longest_edge_px) {
  int longest = 0;
  float longest_square = 0.0F;
  for (int edge = 0; edge < 3; ++edge) {
    const float square = (corner[(edge + 1) % 3].pixel - corner[edge].pixel).squaredNorm();
    if (square > longest_square) {
      longest = edge;
      longest_square = square;
    }
  }
  if (longest_square <= longest_edge_px * longest_edge_px) {
    fill(corner[0], corner[1], corner[2]);
    return;
  }
  const int a = longest;
  const int b = (longest + 1) % 3;
  const int c = (longest + 2) % 3;
  const Vector3f middle = 0.5F * (p[a] + p[b]);
  const Corner middle_corner = corner_of(middle, camera);
  const Corner first[3] = {corner[a], middle_corner, corner[c]};
  const Corner second[3] = {middle_corner, corner[b], corner[c]};
  if (!is_beside_image(box_of(first))) divide(camera, {p[a], middle, p[c]}, first, longest_edge_px);
  if (!is_beside_image(box_of(second)))
    divide(camera, {middle, p[b], p[c]}, second, longest_edge_px);
}

void DepthLayer::fill_row(int y, float left, float right, const Slope& slope) {
  const auto lowest = static_cast<float>(-margin_);
  const auto highest = static_cast<float>(width_ + margin_ - 1);
  const int begin = ceil_of(std::clamp(left, lowest, highest + 1.0F));
  const int end = floor_of(std::clamp(right, lowest - 1.0F, highest)) + 1;
  if (begin >= end) return;
  float* const to = writable_row(y);
  // In registers: the compiler cannot know that the row and the slope do not overlap.
  const auto [from_x, inverse_depth, by_x, least, most] = slope;
  // Most rows of a triangle are a few pixels, too short for vectors: each value follows from the
  // one before, so that the compiler prepares none.
  float inverse = inverse_depth + by_x * (static_cast<float>(begin) - from_x);
  for (int x = begin; x < end; ++x, inverse += by_x)
    to[x] = std::max(to[x], std::min(std::max(inverse, least), most));
  Span& span = spans_[static_cast<std::size_t>(y + margin_)];
  span = span.begin == span.end ? Span{begin, end}
                                : Span{std::min(span.begin, begin), std::max(span.end, end)};
}

void DepthLayer::fill(const Corner& a, const Corner& b, const Corner& c) {
  const Vector2f ab = b.pixel - a.pixel;
  const Vector2f ac = c.pixel - a.pixel;
  const float twice_area = ab.x() * ac.y() - ab.y() * ac.x();
  // Triangles are anticlockwise from outside; y points down, so that this is negative for those
  // that face the camera. Slivers cover no pixel that their neighbours do not.
  constexpr float kLeastTwiceArea = 1e-6F;
  if (!(twice_area < -kLeastTwiceArea)) return;
  // The gradient of 1 / z in the image. In triangles that are seen nearly edge-on it is steep, and
  // rounding would lead beyond the values of the corners.
  const float d_ab = b.inverse_depth - a.inverse_depth;
  const float d_ac = c.inverse_depth - a.inverse_depth;
  const float by_x = (d_ab * ac.y() - d_ac * ab.y()) / twice_area;
  const float by_y = (d_ac * ab.x() - d_ab * ac.x()) / twice_area;
  Slope slope;
  slope.x = a.pixel.x();
  slope.by_x = by_x;
  std::tie(slope.least, slope.most) =
      std::minmax({a.inverse_depth, b.inverse_depth, c.inverse_depth});

  std::array<const Corner*, 3> sorted{&a, &b, &c};
  const auto put_in_order = [](const Corner*& first, const Corner*& second) {
    if (second->pixel.y() < first->pixel.y()) std::swap(first, second);
  };
  put_in_order(sorted[0], sorted[1]);
  put_in_order(sorted[1], sorted[2]);
  put_in_order(sorted[0], sorted[1]);
  const Vector2f top = sorted[0]->pixel;
  const Vector2f middle = sorted[1]->pixel;
  const Vector2f bottom = sorted[2]->pixel;
  const auto x_per_row = [](const Vector2f& from, const Vector2f& to) {
    const float height = to.y() - from.y();
    return height > 0.0F ? (to.x() - from.x()) / height : 0.0F;
  };
  const float along_whole = x_per_row(top, bottom);
  const float along_upper = x_per_row(top, middle);
  const float along_lower = x_per_row(middle, bottom);
  const auto highest = static_cast<float>(-margin_);
  const auto lowest = static_cast<float>(height_ + margin_ - 1);
  const int first = ceil_of(std::clamp(top.y(), highest, lowest + 1.0F));
  const int last = floor_of(std::clamp(bottom.y(), highest - 1.0F, lowest));
  for (int y = first; y <= last; ++y) {
    const auto row_y = static_cast<float>(y);
    const float one = top.x() + along_whole * (row_y - top.y());
    const float other = row_y < middle.y() ? top.x() + along_upper * (row_y - top.y())
                                           : middle.x() + along_lower * (row_y - middle.y());
    slope.inverse_depth = a.inverse_depth + by_y * (row_y - a.pixel.y());
    fill_row(y, std::min(one, other), std::max(one, other), slope);
  }
}

}  // namespace usct::rendering
