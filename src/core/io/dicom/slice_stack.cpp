#include "io/dicom/slice_stack.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "io/format.h"
#include "parallel.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::io {
namespace {

/// Slices of one volume state the same pixel spacing but for the rounding of decimals.
constexpr double kSameSpacing = 1e-3;
/// Difference of a component of a direction: 0.05 mm at the far side of a slice of 500 mm.
constexpr double kSameDirection = 1e-4;
/// Slices closer than this are at one place, whatever the spacing.
constexpr double kSamePlaceMm = 1e-3;
constexpr int kMostSlices = 8192;
/// How many of several faults a message spells out.
constexpr std::size_t kNamed = 4;

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

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<double> gaps_of(const std::vector<double>& depth_mm) {
  std::vector<double> gaps;
  for (std::size_t k = 1; k < depth_mm.size(); ++k) gaps.push_back(depth_mm[k] - depth_mm[k - 1]);
  return gaps;
}

/// Slices at one place become one entry of the order.
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
      gaps.empty() ? kSamePlaceMm : std::max(kSamePlaceMm, tolerance * median(gaps));

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

/// Least squares of value = begin + step * k; returns the largest residual.
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

/// Gaps that are equal within the tolerance, the least first.
struct GapGroup {
  double mean_mm = 0.0;
  std::vector<std::size_t> after;  // the slice (in the order) before each gap
};

std::vector<GapGroup> group_gaps(const SliceStack& stack, double tolerance) {
  const std::vector<double> gaps = gaps_of(stack.depth_mm);
  std::vector<std::size_t> by_size(gaps.size());
  std::iota(by_size.begin(), by_size.end(), std::size_t{0});
  std::stable_sort(by_size.begin(), by_size.end(),
                   [&](std::size_t a, std::size_t b) { return gaps[a] < gaps[b]; });
  std::vector<GapGroup> groups;
  for (const std::size_t k : by_size) {
    if (groups.empty() ||
        gaps[k] > gaps[groups.back().after.front()] + tolerance * stack.spacing_mm)
      groups.emplace_back();
    groups.back().after.push_back(k);
  }
  for (GapGroup& group : groups) {
    for (const std::size_t k : group.after) group.mean_mm += gaps[k];
    group.mean_mm /= static_cast<double>(group.after.size());
    std::sort(group.after.begin(), group.after.end());
  }
  return groups;
}

class Describer {
 public:
  Describer(const std::vector<SlicePose>& slices, const SliceStack& stack)
      : slices_(slices), stack_(stack) {}

  const SlicePose& slice(std::size_t k) const {
    return slices_[static_cast<std::size_t>(stack_.order[k])];
  }

  /// "4.22 mm between 'a' and 'b' (at 1 2 3 mm)".
  std::string gap(std::size_t after) const {
    const SlicePose& a = slice(after);
    const SlicePose& b = slice(after + 1);
    const double apart_mm = (b.position_mm - a.position_mm).norm();
    const double along_mm = stack_.depth_mm[after + 1] - stack_.depth_mm[after];
    std::string out = format(apart_mm) + " mm";
    if (apart_mm - along_mm > kSamePlaceMm) out += " (" + format(along_mm) + " along the normal)";
    return out + " between '" + a.name + "' and '" + b.name + "' (at " + format(a.position_mm) +
           " mm)";
  }

  std::string missing(const std::vector<GapGroup>& groups) const {
    std::string out = "slices are missing: ";
    std::size_t named = 0;
    std::size_t all = 0;
    for (const GapGroup& group : groups) {
      const auto lacking = std::lround(group.mean_mm / stack_.spacing_mm) - 1;
      if (lacking < 1) continue;
      for (const std::size_t after : group.after) {
        if (++all > kNamed) continue;
        out += (named++ > 0 ? "; " : "") + std::to_string(lacking) + " in the gap of " + gap(after);
      }
    }
    return out + more(all) + ", where the spacing is " + format(stack_.spacing_mm) + " mm";
  }

  std::string uneven(const std::vector<GapGroup>& groups) const {
    std::string out = "slice spacing is uneven: ";
    std::size_t named = 0;
    for (const GapGroup& group : groups) {
      if (++named > kNamed) continue;
      out += (named > 1 ? "; " : "") + std::to_string(group.after.size()) + " x " +
             gap(group.after.front());
    }
    return out + more(groups.size());
  }

 private:
  static std::string more(std::size_t all) {
    return all > kNamed ? "; and " + std::to_string(all - kNamed) + " more" : "";
  }

  const std::vector<SlicePose>& slices_;
  const SliceStack& stack_;
};

void find_uneven(const Describer& describe, double tolerance, SliceStack& stack) {
  const std::vector<GapGroup> groups = group_gaps(stack, tolerance);
  stack.least_spacing_mm = groups.front().mean_mm;
  const bool whole_steps = std::all_of(groups.begin(), groups.end(), [&](const GapGroup& group) {
    const double steps = group.mean_mm / stack.spacing_mm;
    return std::lround(steps) >= 1 && std::abs(steps - std::round(steps)) <= tolerance;
  });
  stack.irregular.push_back(whole_steps ? describe.missing(groups) : describe.uneven(groups));
}

/// Sideways shifts: in proportion to the depth if the gantry was tilted.
void find_shifted(const Describer& describe, double tolerance_mm, SliceStack& stack) {
  const auto n = static_cast<double>(stack.order.size());
  const double mean_depth = std::accumulate(stack.depth_mm.begin(), stack.depth_mm.end(), 0.0) / n;
  Eigen::Vector2d mean_shift = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& shift : stack.shift_mm) mean_shift += shift / n;
  double variance = 0.0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < stack.order.size(); ++k) {
    const double depth = stack.depth_mm[k] - mean_depth;
    slope += depth * (stack.shift_mm[k] - mean_shift);
    variance += depth * depth;
  }
  slope /= variance;
  std::size_t worst = 0;
  double worst_mm = 0.0;
  for (std::size_t k = 0; k < stack.order.size(); ++k) {
    const double off_mm =
        (stack.shift_mm[k] - mean_shift - slope * (stack.depth_mm[k] - mean_depth)).norm();
    if (off_mm > worst_mm) {
      worst = k;
      worst_mm = off_mm;
    }
  }
  if (worst_mm > tolerance_mm)
    stack.irregular.push_back("slices are shifted sideways unevenly, '" +
                              describe.slice(worst).name + "' by " + format(worst_mm) + " mm");
  else
    stack.irregular.push_back(
        "gantry tilt of " + format(std::atan(slope.norm()) / kDegree) + " degrees: from '" +
        describe.slice(0).name + "' to '" + describe.slice(stack.order.size() - 1).name +
        "' the slices shift sideways by " +
        format((stack.shift_mm.back() - stack.shift_mm.front()).norm()) + " mm");
}

/// Fits the grid, or says why there is none.
void find_grid(const std::vector<SlicePose>& slices, double tolerance, SliceStack& stack) {
  const Describer describe(slices, stack);
  const double tolerance_mm = tolerance * stack.spacing_mm;
  double begin = 0.0;
  double step = 0.0;
  const bool uneven = fit_steps(stack.depth_mm, &begin, &step) > tolerance_mm;
  stack.least_spacing_mm = step;
  if (uneven) find_uneven(describe, tolerance, stack);

  Eigen::Vector2d shift_sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& shift : stack.shift_mm) shift_sum += shift;
  const Eigen::Vector2d shift = shift_sum / static_cast<double>(stack.order.size());
  const bool shifted =
      std::any_of(stack.shift_mm.begin(), stack.shift_mm.end(),
                  [&](const Eigen::Vector2d& s) { return (s - shift).norm() > tolerance_mm; });
  if (shifted) find_shifted(describe, tolerance_mm, stack);

  const SlicePose& first = describe.slice(0);
  stack.grid.size = {first.size.x(), first.size.y(), static_cast<int>(stack.order.size())};
  stack.grid.spacing_mm = {first.spacing_mm.x(), first.spacing_mm.y(), step};
  stack.grid.direction << first.axes, stack.normal;
  stack.grid.origin_mm = first.position_mm + first.axes * shift + stack.normal * begin;
}

/// One slice at continuous indices; false outside of it.
bool bilinear(const std::int16_t* slice, const Eigen::Vector2i& size, double x, double y,
              double* value) {
  constexpr double kRounding = 1e-6;
  if (!(x >= -kRounding && y >= -kRounding && x <= size.x() - 1 + kRounding &&
        y <= size.y() - 1 + kRounding))
    return false;
  const int x0 = std::clamp(static_cast<int>(x), 0, std::max(0, size.x() - 2));
  const int y0 = std::clamp(static_cast<int>(y), 0, std::max(0, size.y() - 2));
  const int right = size.x() > 1 ? 1 : 0;
  const std::ptrdiff_t below = size.y() > 1 ? size.x() : 0;
  const std::int16_t* at = slice + static_cast<std::ptrdiff_t>(y0) * size.x() + x0;
  const double fx = std::clamp(x - x0, 0.0, 1.0);
  const double fy = std::clamp(y - y0, 0.0, 1.0);
  *value = (1.0 - fy) * ((1.0 - fx) * at[0] + fx * at[right]) +
           fy * ((1.0 - fx) * at[below] + fx * at[below + right]);
  return true;
}

/// The regular grid that covers all slices.
Grid covering_grid(const std::string& source, const std::vector<SlicePose>& slices,
                   const SliceStack& stack) {
  constexpr double kRounding = 1e-3;  // in voxels: what does not add another one
  const SlicePose& first = slices[static_cast<std::size_t>(stack.order.front())];
  const double least_mm = stack.least_spacing_mm;
  // A whole number of steps from the first slice to the last; a little finer than needed.
  const double steps = std::ceil(stack.depth_mm.back() / least_mm - 0.1);
  if (steps + 1.0 > kMostSlices)
    throw InputError(source, "resampling " + format(stack.depth_mm.back()) +
                                 " mm at the least slice spacing of " + format(least_mm) +
                                 " mm needs " + format(steps + 1.0) +
                                 " slices, must be <= " + std::to_string(kMostSlices));
  Eigen::Vector2d low = stack.shift_mm.front();
  Eigen::Vector2d high = low;
  for (const Eigen::Vector2d& shift : stack.shift_mm) {
    low = low.cwiseMin(shift);
    high = high.cwiseMax(shift);
  }
  const Eigen::Array2d begin = (low.cwiseQuotient(first.spacing_mm).array() + kRounding).floor();
  const Eigen::Array2d end = (high.cwiseQuotient(first.spacing_mm).array() - kRounding).ceil();
  Grid grid;
  grid.size.head<2>() = first.size + (end - begin).matrix().cast<int>();
  grid.size.z() = static_cast<int>(steps) + 1;
  grid.spacing_mm = {first.spacing_mm.x(), first.spacing_mm.y(), stack.depth_mm.back() / steps};
  grid.direction << first.axes, stack.normal;
  grid.origin_mm = first.position_mm + first.axes * begin.matrix().cwiseProduct(first.spacing_mm);
  return grid;
}

}  // namespace

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
  stack.spacing_mm = median(gaps_of(stack.depth_mm));
  find_grid(slices, tolerance, stack);
  return stack;
}

CtVolume resample_stack(const std::string& source, const std::vector<SlicePose>& slices,
                        const SliceStack& stack, const std::vector<std::int16_t>& voxels) {
  CtVolume volume(covering_grid(source, slices, stack), kAirHu);
  const Grid& grid = volume.grid;
  const SlicePose& first = slices[static_cast<std::size_t>(stack.order.front())];
  const std::size_t slice_voxels = static_cast<std::size_t>(first.size.prod());
  const Eigen::Vector2d begin_mm = first.axes.transpose() * (grid.origin_mm - first.position_mm);

  parallel_for(grid.size.z(), [&](int k) {
    const double depth = std::min(k * grid.spacing_mm.z(), stack.depth_mm.back());
    const auto above =
        std::upper_bound(stack.depth_mm.begin() + 1, stack.depth_mm.end() - 1, depth);
    const auto b = static_cast<std::size_t>(above - stack.depth_mm.begin());
    const std::size_t a = b - 1;
    double weight = (depth - stack.depth_mm[a]) / (stack.depth_mm[b] - stack.depth_mm[a]);
    constexpr double kOnASlice = 1e-6;  // then its neighbour need not reach as far sideways
    if (weight < kOnASlice) weight = 0.0;
    if (weight > 1.0 - kOnASlice) weight = 1.0;

    const auto index_in = [&](std::size_t slice, int i, int j) -> Eigen::Vector2d {
      return (begin_mm - stack.shift_mm[slice]).cwiseQuotient(first.spacing_mm) +
             Eigen::Vector2d(i, j);
    };
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        double value_a = 0.0;
        double value_b = 0.0;
        const Eigen::Vector2d in_a = index_in(a, i, j);
        const Eigen::Vector2d in_b = index_in(b, i, j);
        if (weight < 1.0 &&
            !bilinear(&voxels[a * slice_voxels], first.size, in_a.x(), in_a.y(), &value_a))
          continue;
        if (weight > 0.0 &&
            !bilinear(&voxels[b * slice_voxels], first.size, in_b.x(), in_b.y(), &value_b))
          continue;
        volume.at(i, j, k) =
            static_cast<std::int16_t>(std::lround((1.0 - weight) * value_a + weight * value_b));
      }
  });
  return volume;
}

}  // namespace usct::io
