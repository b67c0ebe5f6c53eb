#include "us_ct_registration/rendering/picture.h"

#include <png.h>

#include <algorithm>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct {
namespace {

constexpr int kGapPx = 4;
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr std::uint8_t kGapGrey = 60;

int row_height(const std::vector<Picture>& row) {
  int height = 0;
  for (const Picture& picture : row) height = std::max(height, picture.height);
  return height;
}

cv::Mat as_mat(Picture& picture) {
  return {picture.height, picture.width, CV_8UC3, picture.pixels.data()};
}

}  // namespace

void draw_text(Picture& picture, const std::string& text, int x, int y,
               const Picture::Colour& colour, double size) {
  cv::Mat mat = as_mat(picture);
  const auto put = [&](const cv::Scalar& ink, int thickness) {
    cv::putText(mat, text, {x, y}, kFont, size, ink, thickness, cv::LINE_AA);
  };
  put({0, 0, 0}, 3);
  put({double(colour[0]), double(colour[1]), double(colour[2])}, 1);
}

int text_width_px(const std::string& text, double size) {
  int baseline = 0;
  return cv::getTextSize(text, kFont, size, 1, &baseline).width;
}

Picture tile(const std::vector<std::vector<Picture>>& rows) {
  std::vector<int> widths;  // per column
  int sheet_height = -kGapPx;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].width);
    sheet_height += row_height(row) + kGapPx;
  }
  const int sheet_width = std::accumulate(widths.begin(), widths.end(), -kGapPx,
                                          [](int sum, int w) { return sum + w + kGapPx; });
  if (rows.empty() || widths.empty()) return {};

  Picture sheet(sheet_width, sheet_height);
  std::fill(sheet.pixels.begin(), sheet.pixels.end(), kGapGrey);
  int top = 0;
  for (const auto& row : rows) {
    int left = 0;
    for (std::size_t c = 0; c < row.size(); ++c) {
      for (int y = 0; y < row[c].height; ++y)
        std::copy_n(row[c].pixel(0, y), 3 * row[c].width, sheet.pixel(left, top + y));
      left += widths[c] + kGapPx;
    }
    top += row_height(row) + kGapPx;
  }
  return sheet;
}

void write_png(const Picture& picture, const std::filesystem::path& path) {
  if (path.extension() != ".png")
    throw InputError(path.string(),
                     "has extension '" + path.extension().string() + "', a picture's must be .png");
  // PNG is written by libpng. OpenCV's codecs would load a hundred libraries at every start of
  // usct.
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  image.format = PNG_FORMAT_RGB;
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    if (png_image_write_to_file(&image, temporary.c_str(), 0, picture.pixels.data(), 0, nullptr) ==
        0)
      throw std::runtime_error(path.string() + ": writing failed: " + image.message);
  });
}

Picture read_png(const std::filesystem::path& path) {
  constexpr std::uint64_t kMostPixels = 100000000;
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  const auto refuse = [&](const std::string& why) {
    png_image_free(&image);
    throw InputError(path.string(), "the picture cannot be read: " + why);
  };
  if (png_image_begin_read_from_file(&image, path.c_str()) == 0) refuse(image.message);
  if (std::uint64_t{image.width} * image.height > kMostPixels)
    refuse(std::to_string(image.width) + " x " + std::to_string(image.height) +
           " pixels, must be at most " + std::to_string(kMostPixels));
  image.format = PNG_FORMAT_RGB;
  Picture picture(static_cast<int>(image.width), static_cast<int>(image.height));
  const png_color black{0, 0, 0};
  if (png_image_finish_read(&image, &black, picture.pixels.data(), 0, nullptr) == 0)
    refuse(image.message);
  return picture;
}

}  // namespace usct
