#include "us_ct_registration/rendering/overlay.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "rendering/depth_layer.h"
#include "rendering/overlay_contours.h"
#include "rendering/structure_fill.h"
#include "require.h"

namespace usct {
namespace {

using rendering::DepthLayer;
using rendering::Marks;
using rendering::OutlinePixel;
using rendering::Span;

using Outlines = std::vector<std::vector<OutlinePixel>>;

/// Outlines of structures with a band are followed this far beyond the image, pixels, because the
/// band of what is drawn there may reach into it.
constexpr int kBandMarginPx = 160;
/// Weight of a colour that hides what was there.
constexpr unsigned kOpaque = 256;

Picture::Colour in_order(const ImageView& image, const Picture::Colour& rgb) {
  return image.is_bgr ? Picture::Colour(rgb[2], rgb[1], rgb[0]) : rgb;
}

/// The channels 16 bits apart, so that one multiplication weighs all three.
std::uint64_t spread(std::uint64_t first, std::uint64_t second, std::uint64_t third) {
  return first | (second << 16) | (third << 32);
}

/// A colour in the order of the image's channels.
std::uint64_t spread(const ImageView& image, const Picture::Colour& rgb) {
  const Picture::Colour colour = in_order(image, rgb);
  return spread(colour[0], colour[1], colour[2]);
}

/// Mixes a colour into a pixel; the weight is in [0, kOpaque].
void blend(std::uint8_t* pixel, unsigned weight, std::uint64_t colour) {
  const std::uint64_t before = spread(pixel[0], pixel[1], pixel[2]);
  const std::uint64_t mixed = (before * (kOpaque - weight) + colour * weight) >> 8;
  pixel[0] = static_cast<std::uint8_t>(mixed);
  pixel[1] = static_cast<std::uint8_t>(mixed >> 16);
  pixel[2] = static_cast<std::uint8_t>(mixed >> 32);
}

Span within(Span span, int width) {
  return {std::clamp(span.begin, 0, width), std::clamp(span.end, 0, width)};
}

/// The first marked column from `x` on, or `end`. Between the outlines of a structure most columns
/// are not marked: eight of them are passed in one step.
int next_marked(const std::uint8_t* marked, int x, int end) {
  for (; x + 8 <= end; x += 8) {
    std::uint64_t eight = 0;
    std::memcpy(&eight, marked + x, sizeof eight);
    if (eight != 0) break;
  }
  while (x < end && marked[x] == 0) ++x;
  return x;
}

/// Mixes a colour into an image where it is marked, at most with the opacity.
void blend_marks(const ImageView& image, const Marks& marks, const Picture::Colour& rgb,
                 double opacity) {
  const auto most = static_cast<unsigned>(std::lround(kOpaque * opacity));
  const std::uint64_t colour = spread(image, rgb);
  for (int y = 0; y < image.height; ++y) {
    const Span span = marks.span(y);
    const std::uint8_t* const marked = marks.row(y);
    for (int x = next_marked(marked, span.begin, span.end); x < span.end;
         x = next_marked(marked, x + 1, span.end))
      blend(image.row(y) + 3 * x, (marked[x] * most + 127U) / 255U, colour);
  }
}

/// The letters grow with the image: a scale of 0.9 at 1080 rows.
double letter_scale(const ImageView& image) {
  constexpr double kPerHeight = 1.0 / 1200.0;
  constexpr double kLeast = 0.35;
  return std::max(kLeast, kPerHeight * image.height);
}

}  // namespace

/// The memory that the renderer reuses from one image to the next.
struct OverlayRenderer::Buffers {
  std::vector<DepthLayer> layers;  // one per structure
  Marks marks;
  std::vector<float> front;  // of one row: 1 / z of the first surface

  /// 1 / z of the first surface at a pixel.
  float front_at(int x, int y, std::size_t structures) const {
    float nearest = 0.0F;
    for (std::size_t i = 0; i < structures; ++i) {
      const DepthLayer& layer = layers[i];
      const int margin = layer.margin();
      if (x >= -margin && x < layer.width() + margin && y >= -margin && y < layer.height() + margin)
        nearest = std::max(nearest, layer.at(x, y));
    }
    return nearest;
  }

  void find_front(int y, int width, std::size_t structures) {
    front.assign(static_cast<std::size_t>(width), 0.0F);
    for (std::size_t i = 0; i < structures; ++i) {
      const Span span = within(layers[i].span(y), width);
      const float* const from = layers[i].row(y);
      for (int x = span.begin; x < span.end; ++x)
        front[static_cast<std::size_t>(x)] = std::max(front[static_cast<std::size_t>(x)], from[x]);
    }
  }

  /// Fills one structure in a row, and returns how many pixels it covers.
  std::size_t fill_row(const ImageView& image, int y, const DepthLayer& layer,
                       const OverlayStructure& structure, double hidden_depth_mm) const {
    const Span span = within(layer.span(y), image.width);
    const Picture::Colour colour = in_order(image, structure.colour);
    return rendering::fill_structure(
        image.row(y) + 3 * span.begin, layer.row(y) + span.begin, front.data() + span.begin,
        static_cast<std::size_t>(span.end - span.begin),
        {{colour[0], colour[1], colour[2]}, structure.opacity, hidden_depth_mm});
  }

  void mark_outlines(const Outlines& outlines, double width_px, std::size_t structures) {
    constexpr std::size_t kDashPx = 9;
    constexpr float kHiddenMm = 1.0F;  // a surface that lies this far behind another is hidden
    for (const std::vector<OutlinePixel>& outline : outlines)
      for (std::size_t i = 0; i < outline.size(); ++i) {
        const OutlinePixel& at = outline[i];
        const bool is_gap = (i / kDashPx) % 2 == 1;
        if (is_gap && 1.0F / at.inverse_depth - 1.0F / front_at(at.x, at.y, structures) > kHiddenMm)
          continue;
        marks.add_dot(at.x, at.y, 0.5 * width_px);
      }
  }
};

void OverlayOptions::validate(const std::string& source) const {
  require_positive(source, "outline_px", outline_px);
  require_positive(source, "hidden_depth_mm", hidden_depth_mm);
  require_within(source, "band_opacity", band_opacity, 0.0, 1.0);
}

OverlayRenderer::OverlayRenderer(const OverlayOptions& options)
    : options_(options), buffers_(std::make_unique<Buffers>()) {
  options_.validate("overlay");
}
OverlayRenderer::~OverlayRenderer() = default;
OverlayRenderer::OverlayRenderer(OverlayRenderer&&) noexcept = default;
OverlayRenderer& OverlayRenderer::operator=(OverlayRenderer&&) noexcept = default;

OverlayCoverage OverlayRenderer::draw(const ImageView& image, const Camera& camera,
                                      const Eigen::Isometry3d& T_camera_ct,
                                      const std::vector<OverlayStructure>& structures) {
  const CameraIntrinsics& size = camera.intrinsics();
  require(image.width == size.width, "image", "width", image.width,
          "that of the camera, " + std::to_string(size.width));
  require(image.height == size.height, "image", "height", image.height,
          "that of the camera, " + std::to_string(size.height));
  Buffers& b = *buffers_;
  const std::size_t count = structures.size();
  if (b.layers.size() < count) b.layers.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    b.layers[i].reset(image.width, image.height, structures[i].bound_mm ? kBandMarginPx : 0);
    b.layers[i].draw(*structures[i].surface, camera, T_camera_ct, kNearestMm, kLongestEdgePx);
  }
  OverlayCoverage coverage(count, 0);
  for (int y = 0; y < image.height; ++y) {
    b.find_front(y, image.width, count);
    for (std::size_t i = 0; i < count; ++i)
      coverage[i] += b.fill_row(image, y, b.layers[i], structures[i], options_.hidden_depth_mm);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const Outlines outlines = outlines_of(b.layers[i]);
    if (structures[i].bound_mm) {
      b.marks.reset(image.width, image.height);
      rendering::mark_band(outlines, camera, structures[i], b.marks);
      blend_marks(image, b.marks, options_.band_colour, options_.band_opacity);
    }
    b.marks.reset(image.width, image.height);
    b.mark_outlines(outlines, options_.outline_px, count);
    blend_marks(image, b.marks, structures[i].colour, 1.0);
  }
  return coverage;
}

ImageView view_of(Picture& picture) {
  return {picture.pixels.data(), picture.width, picture.height,
          3 * static_cast<std::ptrdiff_t>(picture.width), false};
}

std::size_t letters_per_line(const ImageView& image) {
  constexpr double kLetterPx = 18.0;  // at a scale of 1
  return static_cast<std::size_t>(
      std::max(10.0, image.width / (kLetterPx * letter_scale(image)) - 2.0));
}

void draw_line(const ImageView& image, const std::string& text, int line,
               const Picture::Colour& colour) {
  const double scale = letter_scale(image);
  const int height = static_cast<int>(std::lround(34.0 * scale));
  const int top = line >= 0 ? line * height : image.height + line * height;
  if (top < 0 || top + height > image.height) return;
  cv::Mat mat(image.height, image.width, CV_8UC3, image.pixels,
              static_cast<std::size_t>(image.row_bytes));
  const int thickness = std::max(1, static_cast<int>(std::lround(1.6 * scale)));
  const int width =
      cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, thickness, nullptr).width + height;
  cv::Mat strip = mat(cv::Rect(0, top, std::min(width, image.width), height));
  strip.convertTo(strip, -1, 0.3);
  const Picture::Colour ink = in_order(image, colour);
  cv::putText(mat, text, {height / 2, top + static_cast<int>(std::lround(25.0 * scale))},
              cv::FONT_HERSHEY_SIMPLEX, scale, {double(ink[0]), double(ink[1]), double(ink[2])},
              thickness, cv::LINE_AA);
}

}  // namespace usct
