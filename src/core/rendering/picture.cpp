#include "us_ct_registration/rendering/picture.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct {
namespace {

constexpr int kGapPx = 4;

cv::Mat as_mat(Picture& picture) {
  return {picture.height, picture.width, CV_8UC3, picture.pixels.data()};
}

}  // namespace

void draw_text(Picture& picture, const std::string& text, int x, int y) {
  cv::Mat mat = as_mat(picture);
  const auto put = [&](const cv::Scalar& colour, int thickness) {
    cv::putText(mat, text, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.45, colour, thickness, cv::LINE_AA);
  };
  put({0, 0, 0}, 3);
  put({255, 255, 255}, 1);
}

Picture tile(const std::vector<std::vector<Picture>>& rows) {
  int width = 0;
  int height = 0;
  std::size_t columns = 0;
  for (const auto& row : rows) {
    columns = std::max(columns, row.size());
    for (const Picture& picture : row) {
      width = std::max(width, picture.width);
      height = std::max(height, picture.height);
    }
  }
  const auto span = [](std::size_t count, int size) {
    return count == 0 ? 0 : static_cast<int>(count) * (size + kGapPx) - kGapPx;
  };
  Picture sheet(span(columns, width), span(rows.size(), height));
  std::fill(sheet.pixels.begin(), sheet.pixels.end(), std::uint8_t{60});
  for (std::size_t r = 0; r < rows.size(); ++r)
    for (std::size_t c = 0; c < rows[r].size(); ++c) {
      const Picture& picture = rows[r][c];
      for (int y = 0; y < picture.height; ++y)
        std::copy_n(picture.pixel(0, y), 3 * picture.width,
                    sheet.pixel(static_cast<int>(c) * (width + kGapPx),
                                static_cast<int>(r) * (height + kGapPx) + y));
    }
  return sheet;
}

void write_png(const Picture& picture, const std::filesystem::path& path) {
  if (path.extension() != ".png")
    throw InputError(path.string(),
                     "has extension '" + path.extension().string() + "', a picture's must be .png");
  Picture copy = picture;
  cv::Mat bgr;
  cv::cvtColor(as_mat(copy), bgr, cv::COLOR_RGB2BGR);
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    if (!cv::imwrite(temporary.string(), bgr))
      throw InputError(path.string(), "the picture cannot be written");
  });
}

}  // namespace usct
