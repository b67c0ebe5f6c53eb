#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/camera.h"
#include "us_ct_registration/rendering/picture.h"
#include "us_ct_registration/rendering/surface.h"

/// Surfaces of the CT, drawn into the image of a camera by the processor alone.
namespace usct {

/// An image with three 8-bit channels per pixel that belongs to the caller.
struct ImageView {
  std::uint8_t* pixels = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t row_bytes = 0;
  /// The channels are blue, green, red, and not red, green, blue.
  bool is_bgr = false;

  std::uint8_t* row(int y) const { return pixels + y * row_bytes; }
};

/// The whole picture.
ImageView view_of(Picture& picture);

/// A surface and the style in which it is drawn.
struct OverlayStructure {
  std::shared_ptr<const Surface> surface;
  std::string name;
  Picture::Colour colour{255, 255, 255};
  /// Opacity of the fill where no other surface lies before it, [0, 1]. The outline is opaque.
  double opacity = 0.25;
  /// Radius of the uncertainty band, mm: the true position of each point of the surface is that far
  /// away or less, with the probability that the caller has chosen. Unset: no band.
  std::optional<double> bound_mm;
  /// Error of the camera itself, pixels, by which the band is wider.
  double bound_px = 0.0;
};

struct OverlayOptions {
  /// Width of the outlines, pixels.
  double outline_px = 3.0;
  /// A structure that lies this far (mm) behind the first surface on the line of sight is filled
  /// with half its opacity; with 2 d a third, with 3 d a fourth.
  double hidden_depth_mm = 15.0;
  Picture::Colour band_colour{255, 220, 0};
  double band_opacity = 0.3;

  /// Throws InputError, naming `source`, if a length is not finite and > 0 or the opacity is not in
  /// [0, 1].
  void validate(const std::string& source) const;
};

/// Pixels that a structure covers, in the order of the structures; 0: it is not in view.
using OverlayCoverage = std::vector<std::size_t>;

/// Draws surfaces of the CT into images of a camera, as they would be seen through tissue:
///
/// - a translucent fill, fainter the deeper it lies behind the first surface on the line of sight;
/// - the outline, dashed where another surface lies before it;
/// - around the outline of a structure with a bound, the uncertainty band: all pixels at which the
///   true outline may be, if its error is below the bound in any direction.
///
/// Corners of triangles are projected with the distortion of the camera. In an image with
/// distortion, triangles are divided until their edges are shorter than `kLongestEdgePx`; the
/// straight edge then differs from the true curve by less than 0.1 px for the lenses of endoscopes.
/// Triangles with a corner nearer than `kNearestMm` to the camera's plane are not drawn, so that
/// nothing behind the camera appears.
///
/// The buffers are kept between images: one object per thread and camera.
class OverlayRenderer {
 public:
  static constexpr double kNearestMm = 1.0;
  static constexpr double kLongestEdgePx = 32.0;

  /// Throws InputError if an option is invalid.
  explicit OverlayRenderer(const OverlayOptions& options = {});
  ~OverlayRenderer();
  OverlayRenderer(OverlayRenderer&&) noexcept;
  OverlayRenderer& operator=(OverlayRenderer&&) noexcept;

  /// Draws the structures in their order; `T_camera_ct` maps points of the surfaces to the optical
  /// frame of the camera, mm. Throws InputError if the image has not the size of the camera's.
  OverlayCoverage draw(const ImageView& image, const Camera& camera,
                       const Eigen::Isometry3d& T_camera_ct,
                       const std::vector<OverlayStructure>& structures);

 private:
  struct Buffers;
  OverlayOptions options_;
  std::unique_ptr<Buffers> buffers_;
};

/// The number of letters of average width that fit into a line of `draw_line`.
std::size_t letters_per_line(const ImageView& image);

/// A line of text over the image, on a dark strip from its left edge; `line` counts from the top,
/// or from the bottom if it is negative. The letters grow with the image.
void draw_line(const ImageView& image, const std::string& text, int line,
               const Picture::Colour& colour);

}  // namespace usct
