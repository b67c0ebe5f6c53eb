#include "io/dicom/slice_stack.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "io/dicom/slice_irregularities.h"
#include "io/format.h"
#include "order_statistics.h"

namespace usct::io {
namespace {

/// Slices of one volume state the same pixel spacing up to the rounding of decimals.
constexpr double kSameSpacing = 1e-3;
/// Largest difference between components of equal directions: it shifts the far side of a slice of
/// 500 mm by 0.05 mm.
constexpr double kSameDirection = 1e-4;

std::string mixed(const char* what, const SlicePose& a, const std::string& of_a, const SlicePose& b,
                  const std::string& of_b) {
  return std::string("slices differ in ") + what + ": " + of_a + " in '" + a.name + "', " + of_b +
         " in '" + b.name + "'";
}

void find_mixed(const std::vector<SlicePose>& slices, std::vector<std::string>& fatal) {
  const SlicePose& a = slices.front();
  const auto report_first = [&](const char* what, const auto& value_of, const auto& differs) {
    for (const SlicePose& b : slices)
      if (differs(b)) {
        fatal.push_back(mixed(what, a, format(value_of(a)), b, format(value_of(b))));
        return;
      }
  };
  report_first(
      "size (columns, rows)", [](const SlicePose& s) { return s.size; },
      [&](const SlicePose& b) { return b.size != a.size; });
  report_first(
      "pixel spacing (mm)", [](const SlicePose& s) { return s.spacing_mm; },
      [&](const SlicePose& b) {
        return ((b.spacing_mm - a.spacing_mm).array().abs() > kSameSpacing * a.spacing_mm.array())
            .any();
      });
  report_first(
      "orientation", [](const SlicePose& s) { return s.axes; },
      [&](const SlicePose& b) { return (b.axes - a.axes).cwiseAbs().maxCoeff() > kSameDirection; });
}

/// Fills the order of `stack`. Slices at one place become one entry.
void order_by_depth(const std::vector<SlicePose>& slices, double tolerance, SliceStack& stack) {
  std::vector<int> sorted(slices.size());
  std::iota(sorted.begin(), sorted.end(), 0);
  const auto depth = [&](int i) {
    return stack.normal.dot(slices[static_cast<std::size_t>(i)].position_mm);
  };
  std::stable_sort(sorted.begin(), sorted.end(), [&](int a, int b) { return depth(a) < depth(b); });

  std::vector<double> gaps;
  for (std::size_t k = 1; k < sorted.size(); ++k) {
    const double gap = depth(sorted[k]) - depth(sorted[k - 1]);
    if (gap > kSamePlaceMm) gaps.push_back(gap);
  }
  const double same_place_mm =
      gaps.empty() ? kSamePlaceMm
                   : std::max(kSamePlaceMm, tolerance * value_of_rank(gaps, gaps.size() / 2));

  const SlicePose& first = slices[static_cast<std::size_t>(sorted.front())];
  for (const int i : sorted) {
    const double depth_mm = depth(i) - depth(sorted.front());
    if (!stack.order.empty() && depth_mm - stack.depth_mm.back() <= same_place_mm) {
      stack.duplicates.back().push_back(i);
      continue;
    }
    stack.order.push_back(i);
    stack.duplicates.emplace_back();
    stack.depth_mm.push_back(depth_mm);
    stack.shift_mm.push_back(first.axes.transpose() *
                             (slices[static_cast<std::size_t>(i)].position_mm - first.position_mm));
  }
}

/// Fits value[k] = begin + step * k by least squares. Returns the largest residual.
double fit_steps(const std::vector<double>& values, double* begin, double* step) {
  const auto n = static_cast<double>(values.size());
  const double mean_k = 0.5 * (n - 1.0);
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double covariance = 0.0;
  for (std::size_t k = 0; k < values.size(); ++k)
    covariance += (static_cast<double>(k) - mean_k) * (values[k] - mean);
  *step = covariance / (n * (n * n - 1.0) / 12.0);
  *begin = mean - *step * mean_k;
  double worst = 0.0;
  for (std::size_t k = 0; k < values.size(); ++k)
    worst = std::max(worst, std::abs(values[k] - *begin - *step * static_cast<double>(k)));
  return worst;
}

/// Fits the grid to all slices, and reports slices that deviate from it.
void find_grid(const std::vector<SlicePose>& slices, double tolerance, SliceStack& stack) {
  const double tolerance_mm = tolerance * stack.spacing_mm;
  double begin = 0.0;
  double step = 0.0;
  const bool uneven = fit_steps(stack.depth_mm, &begin, &step) > tolerance_mm;
  stack.least_spacing_mm = step;
  if (uneven) report_uneven(slices, tolerance, stack);

  Eigen::Vector2d shift_sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& shift : stack.shift_mm) shift_sum += shift;
  const Eigen::Vector2d shift = shift_sum / static_cast<double>(stack.order.size());
  const bool shifted =
      std::any_of(stack.shift_mm.begin(), stack.shift_mm.end(),
                  [&](const Eigen::Vector2d& s) { return (s - shift).norm() > tolerance_mm; });
  if (shifted) report_shifted(slices, tolerance_mm, stack);

  const SlicePose& first = slices[static_cast<std::size_t>(stack.order.front())];
  stack.grid.size = {first.size.x(), first.size.y(), static_cast<int>(stack.order.size())};
  stack.grid.spacing_mm = {first.spacing_mm.x(), first.spacing_mm.y(), step};
  stack.grid.direction << first.axes, stack.normal;
  stack.grid.origin_mm = first.position_mm + first.axes * shift + stack.normal * begin;
}

}  // namespace

std::vector<double> gaps_of(const std::vector<double>& depth_mm) {
  std::vector<double> gaps;
  for (std::size_t k = 1; k < depth_mm.size(); ++k) gaps.push_back(depth_mm[k] - depth_mm[k - 1]);
  return gaps;
}

SliceStack stack_slices(const std::vector<SlicePose>& slices, double tolerance) {
  SliceStack stack;
  if (slices.empty()) {
    stack.fatal.push_back("there are no slices");
    return stack;
  }
  find_mixed(slices, stack.fatal);
  if (!stack.fatal.empty()) return stack;
  stack.normal = slices.front().axes.col(0).cross(slices.front().axes.col(1)).normalized();
  order_by_depth(slices, tolerance, stack);
  if (stack.order.size() < 2) {
    stack.fatal.push_back(
        "all slices are at one place, so the slice spacing is not known; must "
        "be >= 2 at different places");
    return stack;
  }
  const std::vector<double> gaps = gaps_of(stack.depth_mm);
  stack.spacing_mm = value_of_rank(gaps, gaps.size() / 2);
  find_grid(slices, tolerance, stack);
  return stack;
}

}  // namespace usct::io
