#include <gtest/gtest.h>

#include "core/io/expect_input_error.h"
#include "us_ct_registration/rendering/plot.h"

namespace usct::test {
namespace {

int pixels_that_differ(const Picture& a, const Picture& b) {
  int count = 0;
  for (std::size_t i = 0; i < a.pixels.size(); i += 3)
    if (!std::equal(a.pixels.begin() + static_cast<std::ptrdiff_t>(i),
                    a.pixels.begin() + static_cast<std::ptrdiff_t>(i) + 3,
                    b.pixels.begin() + static_cast<std::ptrdiff_t>(i)))
      ++count;
  return count;
}

/// Mean position of what a series adds.
Eigen::Vector2d middle_of_change(const Picture& empty, const Picture& with) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  for (int y = 0; y < empty.height; ++y)
    for (int x = 0; x < empty.width; ++x)
      if (!std::equal(empty.pixel(x, y), empty.pixel(x, y) + 3, with.pixel(x, y))) {
        sum += Eigen::Vector2d(x, y);
        ++count;
      }
  return sum / count;
}

TEST(Plot, PutsPointsWhereTheAxesSay) {
  const PlotAxes axes{"x", "y", 10.0, 4.0};
  const Picture empty = plot(axes, {});
  const auto at = [&](double x, double y) {
    return middle_of_change(empty, plot(axes, {{"", {{x, y}}, false}}));
  };
  const Eigen::Vector2d left_bottom = at(0.0, 0.0);
  const Eigen::Vector2d right_top = at(10.0, 4.0);
  EXPECT_LT(left_bottom.x(), right_top.x());
  EXPECT_GT(left_bottom.y(), right_top.y());
  const Eigen::Vector2d middle = at(5.0, 2.0);
  EXPECT_LT((middle - 0.5 * (left_bottom + right_top)).norm(), 1.5);
  EXPECT_LT((at(1e6, 1e6) - right_top).norm(), 1e-9);  // at the ends
}

TEST(Plot, JoinsPointsAndNamesSeries) {
  const PlotAxes axes{"x", "y", 10.0, 4.0};
  const Picture empty = plot(axes, {});
  const std::vector<Eigen::Vector2d> points{{1.0, 1.0}, {9.0, 3.0}};
  const int dots = pixels_that_differ(empty, plot(axes, {{"", points, false}}));
  const int line = pixels_that_differ(empty, plot(axes, {{"", points, true}}));
  EXPECT_GT(dots, 20);
  EXPECT_GT(line, 4 * dots);
  EXPECT_GT(pixels_that_differ(plot(axes, {{"", {}, true}}), plot(axes, {{"name", {}, true}})), 20);
}

TEST(Plot, RefusesWhatCannotBeDrawn) {
  expect_input_error([] { plot({"x", "y", 0.0, 1.0}, {}); }, {"plot", "> 0"});
  expect_input_error(
      [] {
        plot({"x", "y", 1.0, 1.0}, {{"", {{0.0, std::nan("")}}, true}});
      },
      {"plot", "not finite"});
}

}  // namespace
}  // namespace usct::test
