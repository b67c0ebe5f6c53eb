#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "us_ct_registration/geometry/camera.h"
#include "us_ct_registration/rendering/surface.h"

namespace usct::rendering {

/// The columns of a row that were written, from `begin` to before `end`; empty if they are equal.
struct Span {
  int begin = 0;
  int end = 0;
};

/// The nearest depth of one surface at each pixel of an image and of a margin around it.
///
/// Stored is 1 / z (z in mm along the optical axis), which is linear within a projected triangle;
/// 0: the surface does not cover the pixel.
class DepthLayer {
 public:
  /// Forgets what was drawn, which takes time only for the pixels that were written.
  void reset(int width, int height, int margin);

  /// Draws the triangles that face the camera.
  void draw(const Surface& surface, const Camera& camera, const Eigen::Isometry3d& T_camera_surface,
            double nearest_mm, double longest_edge_px);

  int margin() const { return margin_; }
  int height() const { return height_; }
  int width() const { return width_; }
  /// Rows and columns are those of the image: in [-margin, size + margin).
  const float* row(int y) const {
    return inverse_depth_.data() + static_cast<std::ptrdiff_t>(y + margin_) * columns_ + margin_;
  }
  /// All pixels of the row that the surface covers are within the span, in columns of the image.
  Span span(int y) const { return spans_[static_cast<std::size_t>(y + margin_)]; }
  float at(int x, int y) const { return row(y)[x]; }

 private:
  /// A corner in the image, with 1 / z.
  struct Corner {
    Eigen::Vector2f pixel;
    float inverse_depth;
  };

  /// The pixels between `least` and `most` in both directions.
  struct Box {
    Eigen::Vector2f least;
    Eigen::Vector2f most;
  };

  /// 1 / z along a row of a triangle: `inverse_depth` at column `x`, and its range at the corners.
  struct Slope {
    float x;
    float inverse_depth;
    float by_x;
    float least;
    float most;
  };

  void project(const Surface& surface, const Camera& camera,
               const Eigen::Isometry3d& T_camera_surface, double nearest_mm);
  Corner corner_of(const Eigen::Vector3f& p, const Camera& camera) const;
  void divide(const Camera& camera, const Eigen::Vector3f (&p)[3], const Corner (&corner)[3],
              float longest_edge_px);
  void fill(const Corner& a, const Corner& b, const Corner& c);
  void fill_row(int y, float left, float right, const Slope& slope);
  float* writable_row(int y) { return const_cast<float*>(row(y)); }
  static Box box_of(const Corner (&corner)[3]);
  bool is_beside_image(const Box& box) const;

  int width_ = 0;
  int height_ = 0;
  int margin_ = 0;
  std::ptrdiff_t columns_ = 0;
  std::vector<float> inverse_depth_;
  std::vector<Span> spans_;
  // The points of the surface that is drawn, in the camera's frame and in the image; 1 / z is 0
  // for points that are not before the camera.
  std::vector<Eigen::Vector3f> points_mm_;
  std::vector<Corner> corners_;
};

}  // namespace usct::rendering
