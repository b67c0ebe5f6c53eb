#pragma once

#include <cstdint>
#include <vector>

#include "rendering/depth_layer.h"
#include "us_ct_registration/rendering/overlay.h"

/// The outlines of surfaces in an image, and the marks that are drawn along them.
namespace usct::rendering {

/// A pixel of an outline, with 1 / z (1/mm) of the surface there.
struct OutlinePixel {
  int x;
  int y;
  float inverse_depth;
};

/// The border of the covered pixels: closed curves of neighbouring pixels, and pieces of them where
/// the border leaves the layer.
std::vector<std::vector<OutlinePixel>> outlines_of(const DepthLayer& layer);

/// For each pixel of an image, the share of it that is marked, 0 to 255.
class Marks {
 public:
  void reset(int width, int height);
  /// Marks a disc with a soft edge, for lines of a few pixels.
  void add_dot(int x, int y, double radius_px);
  /// Marks all pixels within the radius.
  void add_disc(int x, int y, double radius_px);

  int height() const { return height_; }
  const std::uint8_t* row(int y) const {
    return marked_.data() + static_cast<std::ptrdiff_t>(y) * width_;
  }
  Span span(int y) const { return spans_[static_cast<std::size_t>(y)]; }

 private:
  void widen(int y, int begin, int end);

  int width_ = 0;
  int height_ = 0;
  std::vector<std::uint8_t> marked_;
  std::vector<Span> spans_;
};

/// Marks all pixels at which the outlines may truly be, if each point of the surface may be
/// `structure.bound_mm` away from where it is drawn, in any direction.
void mark_band(const std::vector<std::vector<OutlinePixel>>& outlines, const Camera& camera,
               const OverlayStructure& structure, Marks& marks);

}  // namespace usct::rendering
