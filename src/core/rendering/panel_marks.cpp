#include "rendering/panel_marks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include "text.h"

namespace usct::rendering {
namespace {

const Picture::Colour kWhite(255, 255, 255);
const Picture::Colour kBlack(0, 0, 0);
const Picture::Colour kDirectionColour(255, 225, 120);

/// Fills a rectangle as far as it lies within the picture.
void fill(Picture& picture, int left, int top, int width, int height,
          const Picture::Colour& colour) {
  for (int y = std::max(0, top); y < std::min(top + height, picture.height); ++y)
    for (int x = std::max(0, left); x < std::min(left + width, picture.width); ++x)
      std::copy_n(colour.data(), 3, picture.pixel(x, y));
}

/// A white rectangle with a black edge, which is visible on any background.
void fill_edged(Picture& picture, int left, int top, int width, int height) {
  fill(picture, left - 1, top - 1, width + 2, height + 2, kBlack);
  fill(picture, left, top, width, height, kWhite);
}

/// Appends a line in parts that are at most `width` pixels wide, broken at blanks; a wider word has
/// a line of its own.
void append_broken(std::string_view line, int width, double size, std::vector<std::string>& parts) {
  bool is_first = true;
  for (const std::string_view word : words(line)) {
    std::string longer = is_first ? "" : parts.back() + " ";
    longer += word;
    if (is_first || text_width_px(longer, size) > width)
      parts.emplace_back(word);
    else
      parts.back() = std::move(longer);
    is_first = false;
  }
}

}  // namespace

std::string patient_direction(const Eigen::Vector3d& direction_ct) {
  constexpr double kOblique = 0.3827;  // sine of 22.5 degrees
  constexpr std::array<const char*, 3> kPositive = {"L", "P", "H"};
  constexpr std::array<const char*, 3> kNegative = {"R", "A", "F"};
  std::array<std::size_t, 3> axes = {0, 1, 2};
  const auto share = [&](std::size_t axis) {
    return std::abs(direction_ct[static_cast<Eigen::Index>(axis)]);
  };
  std::sort(axes.begin(), axes.end(),
            [&](std::size_t a, std::size_t b) { return share(a) > share(b); });
  std::string letters;
  for (const std::size_t axis : {axes[0], axes[1]})
    if (letters.empty() || share(axis) > kOblique)
      letters +=
          direction_ct[static_cast<Eigen::Index>(axis)] > 0.0 ? kPositive[axis] : kNegative[axis];
  return letters;
}

int line_px(double size) { return static_cast<int>(std::lround(53.0 * size)); }

Picture text_block(const std::string& text, int width, const TextStyle& style) {
  std::vector<std::string> lines;
  for (const std::string_view line : split(text, '\n'))
    append_broken(line, width - 2 * kMarginPx, style.size, lines);
  const int line_height = line_px(style.size);
  Picture block(width, line_height * static_cast<int>(lines.size()));
  fill(block, 0, 0, block.width, block.height, style.background);
  int bottom = 0;
  for (const std::string& line : lines)
    draw_text(block, line, kMarginPx, (bottom += line_height) - line_height / 4, style.ink,
              style.size);
  return block;
}

void draw_frame(Picture& picture, const std::string& word, const Picture::Colour& colour,
                double size) {
  constexpr int kFramePx = 3;
  fill(picture, 0, 0, picture.width, kFramePx, colour);
  fill(picture, 0, picture.height - kFramePx, picture.width, kFramePx, colour);
  fill(picture, 0, 0, kFramePx, picture.height, colour);
  fill(picture, picture.width - kFramePx, 0, kFramePx, picture.height, colour);
  draw_text(picture, word, kMarginPx, picture.height - 2 * kMarginPx, colour, size);
}

void draw_scale_bar(Picture& picture, double pixel_mm, double size) {
  constexpr int kBarPx = 4;
  for (const int length_mm : {50, 20, 10, 5}) {
    const int length_px = static_cast<int>(std::lround(length_mm / pixel_mm));
    if (4 * length_px >= picture.width) continue;
    const int left = picture.width - 2 * kMarginPx - length_px;
    const int top = picture.height - 2 * kMarginPx - kBarPx;
    fill_edged(picture, left, top, length_px, kBarPx);
    const std::string length = std::to_string(length_mm) + " mm";
    const int rightmost = picture.width - kMarginPx - text_width_px(length, size);
    draw_text(picture, length, std::min(left, rightmost), top - kMarginPx, kWhite, size);
    return;
  }
}

void draw_patient_directions(Picture& picture, const SlicePlane& plane,
                             const Eigen::Isometry3d& T_us_ct, double size) {
  const int letter_height = line_px(size) / 2;
  const auto put = [&](const Eigen::Vector3d& direction_us, double x_share, double y_share) {
    const std::string letters = patient_direction(T_us_ct.linear().transpose() * direction_us);
    const int room_x = picture.width - 4 * kMarginPx - text_width_px(letters, size);
    const int room_y = picture.height - 4 * kMarginPx - letter_height;
    draw_text(picture, letters, 2 * kMarginPx + static_cast<int>(x_share * room_x),
              2 * kMarginPx + letter_height + static_cast<int>(y_share * room_y), kDirectionColour,
              size);
  };
  put(-plane.right, 0.0, 0.5);
  put(plane.right, 1.0, 0.5);
  put(-plane.down, 0.5, 0.0);
  put(plane.down, 0.5, 1.0);
}

void draw_ticks(Picture& picture, const SlicePlane& plane, const Eigen::Vector3d& centre_us_mm) {
  constexpr int kTickPx = 10;
  const Eigen::Vector3d offset_mm = centre_us_mm - plane.centre_mm;
  const auto pixel = [&](const Eigen::Vector3d& axis, int size) {
    return static_cast<int>(std::lround(axis.dot(offset_mm) / plane.pixel_mm + 0.5 * (size - 1)));
  };
  const int x = pixel(plane.right, plane.width);
  const int y = pixel(plane.down, plane.height);
  for (const int top : {0, picture.height - kTickPx}) fill_edged(picture, x, top, 1, kTickPx);
  for (const int left : {0, picture.width - kTickPx}) fill_edged(picture, left, y, kTickPx, 1);
}

}  // namespace usct::rendering
