#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace usct {

/// 8-bit RGB, rows from the top, pixels[3 * (y * width + x) + channel].
struct Picture {
  using Colour = Eigen::Matrix<std::uint8_t, 3, 1>;

  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;

  Picture() = default;
  Picture(int width_in, int height_in)
      : width(width_in),
        height(height_in),
        pixels(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  std::uint8_t* pixel(int x, int y) {
    return pixels.data() + 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                static_cast<std::size_t>(x));
  }
  const std::uint8_t* pixel(int x, int y) const { return const_cast<Picture*>(this)->pixel(x, y); }
};

/// Size of text in captions: capitals are 10 pixels high. It is proportional to their height.
constexpr double kCaptionSize = 0.45;

/// Writes text with its lower left corner at (x, y), with a black edge.
void draw_text(Picture& picture, const std::string& text, int x, int y,
               const Picture::Colour& colour = {255, 255, 255}, double size = kCaptionSize);

/// Width of a text that `draw_text` writes, pixels.
int text_width_px(const std::string& text, double size = kCaptionSize);

/// Pictures in rows and columns with a thin gap; a row is as high as its highest picture, a column
/// as wide as its widest.
Picture tile(const std::vector<std::vector<Picture>>& rows);

/// Writes atomically. Throws InputError if the path does not end in .png or cannot be written.
void write_png(const Picture& picture, const std::filesystem::path& path);

/// Reads a PNG of any kind; transparent pixels are laid over black. Throws InputError, naming the
/// path, if it is not one or has more than 100 million pixels.
Picture read_png(const std::filesystem::path& path);

}  // namespace usct
