#include "us_ct_registration/rendering/plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr int kWidth = 720;
constexpr int kHeight = 540;
constexpr int kLeft = 70;
constexpr int kRight = 20;
constexpr int kTop = 30;
constexpr int kBottom = 60;
constexpr int kLegendLinePx = 18;
constexpr int kTicks = 6;
const cv::Scalar kGrid(60, 60, 60);
const cv::Scalar kAxis(200, 200, 200);
const std::array<Picture::Colour, 8> kColours{{{90, 170, 255},
                                               {255, 160, 60},
                                               {110, 220, 110},
                                               {255, 110, 110},
                                               {200, 140, 255},
                                               {240, 220, 80},
                                               {100, 220, 220},
                                               {220, 220, 220}}};

/// Multiples of 1, 2 or 5 times a power of ten from 0 to `max`, about `kTicks` of them.
std::vector<double> ticks(double max) {
  const double rough = max / kTicks;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * power >= rough) step = factor * power;
  const int last = static_cast<int>(max / step + 1e-9);
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(last) + 1);
  for (int i = 0; i <= last; ++i) values.push_back(i * step);
  return values;
}

std::string tick_text(double value) {
  std::array<char, 32> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%g", value);
  return buffer.data();
}

/// A picture, and where its axes put a point.
class Canvas {
 public:
  explicit Canvas(const PlotAxes& axes) : axes_(axes), picture_(kWidth, kHeight) {
    std::fill(picture_.pixels.begin(), picture_.pixels.end(), std::uint8_t{20});
  }

  cv::Point at(double x, double y) const {
    const double right = std::clamp(x / axes_.x_max, 0.0, 1.0) * (kWidth - kLeft - kRight);
    const double up = std::clamp(y / axes_.y_max, 0.0, 1.0) * (kHeight - kTop - kBottom);
    return {kLeft + static_cast<int>(std::lround(right)),
            kHeight - kBottom - static_cast<int>(std::lround(up))};
  }
  cv::Mat mat() { return {picture_.height, picture_.width, CV_8UC3, picture_.pixels.data()}; }
  Picture& picture() { return picture_; }

 private:
  const PlotAxes& axes_;
  Picture picture_;
};

void draw_axes(Canvas& canvas, const PlotAxes& axes) {
  const cv::Mat mat = canvas.mat();
  for (const double x : ticks(axes.x_max)) {
    cv::line(mat, canvas.at(x, 0.0), canvas.at(x, axes.y_max), kGrid);
    draw_text(canvas.picture(), tick_text(x), canvas.at(x, 0.0).x - 6, kHeight - kBottom + 18);
  }
  for (const double y : ticks(axes.y_max)) {
    cv::line(mat, canvas.at(0.0, y), canvas.at(axes.x_max, y), kGrid);
    draw_text(canvas.picture(), tick_text(y), kLeft - 42, canvas.at(0.0, y).y + 5);
  }
  cv::line(mat, canvas.at(0.0, 0.0), canvas.at(axes.x_max, 0.0), kAxis);
  cv::line(mat, canvas.at(0.0, 0.0), canvas.at(0.0, axes.y_max), kAxis);
  draw_text(canvas.picture(), axes.x_label, kWidth / 2 - 80, kHeight - 16);
  draw_text(canvas.picture(), axes.y_label, 8, kTop - 12);
}

void draw_series(Canvas& canvas, const PlotSeries& series, const Picture::Colour& colour) {
  const cv::Scalar ink(colour[0], colour[1], colour[2]);
  const cv::Mat mat = canvas.mat();
  for (std::size_t i = 0; i < series.points.size(); ++i) {
    const cv::Point point = canvas.at(series.points[i].x(), series.points[i].y());
    if (!series.joined)
      cv::circle(mat, point, 3, ink, cv::FILLED, cv::LINE_AA);
    else if (i > 0)
      cv::line(mat, canvas.at(series.points[i - 1].x(), series.points[i - 1].y()), point, ink, 2,
               cv::LINE_AA);
  }
}

}  // namespace

Picture plot(const PlotAxes& axes, const std::vector<PlotSeries>& series) {
  for (const double max : {axes.x_max, axes.y_max})
    if (!(std::isfinite(max) && max > 0.0))
      throw InputError("plot",
                       "an axis ends at " + std::to_string(max) + ", must be finite and > 0");
  Canvas canvas(axes);
  draw_axes(canvas, axes);
  const auto named = std::count_if(series.begin(), series.end(),
                                   [](const PlotSeries& one) { return !one.name.empty(); });
  int legend_y = kHeight - kBottom - kLegendLinePx * static_cast<int>(named);
  for (std::size_t i = 0; i < series.size(); ++i) {
    const Picture::Colour& colour = kColours[i % kColours.size()];
    for (const Eigen::Vector2d& point : series[i].points)
      if (!point.allFinite()) throw InputError("plot", "a point is not finite");
    draw_series(canvas, series[i], colour);
    if (series[i].name.empty()) continue;
    draw_text(canvas.picture(), series[i].name, kWidth - 190, legend_y, colour);
    legend_y += kLegendLinePx;
  }
  return canvas.picture();
}

}  // namespace usct
