#include "io/dicom/slice_irregularities.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "io/format.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::io {
namespace {

/// Greatest number of faults that a message lists.
constexpr std::size_t kNamedGaps = 4;

/// Gaps between neighbours that are equal within the tolerance.
struct GapGroup {
  double mean_mm = 0.0;
  std::vector<std::size_t> after;  // for each gap the slice before it, as an index into the order
};

/// All gaps in groups, the group of the least gaps first.
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

/// Words for slices and gaps of a stack.
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
        if (++all > kNamedGaps) continue;
        out += (named++ > 0 ? "; " : "") + std::to_string(lacking) + " in the gap of " + gap(after);
      }
    }
    return out + more(all) + ", where the spacing is " + format(stack_.spacing_mm) + " mm";
  }

  std::string uneven(const std::vector<GapGroup>& groups) const {
    std::string out = "slice spacing is uneven: ";
    std::size_t named = 0;
    for (const GapGroup& group : groups) {
      if (++named > kNamedGaps) continue;
      out += (named > 1 ? "; " : "") + std::to_string(group.after.size()) + " x " +
             gap(group.after.front());
    }
    return out + more(groups.size());
  }

 private:
  static std::string more(std::size_t all) {
    return all > kNamedGaps ? "; and " + std::to_string(all - kNamedGaps) + " more" : "";
  }

  const std::vector<SlicePose>& slices_;
  const SliceStack& stack_;
};

/// The line, by least squares, that the sideways shifts follow along the depth.
struct Tilt {
  double mean_depth_mm = 0.0;
  Eigen::Vector2d mean_shift_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

Tilt fit_tilt(const SliceStack& stack) {
  const auto n = static_cast<double>(stack.order.size());
  Tilt tilt;
  tilt.mean_depth_mm = std::accumulate(stack.depth_mm.begin(), stack.depth_mm.end(), 0.0) / n;
  for (const Eigen::Vector2d& shift : stack.shift_mm) tilt.mean_shift_mm += shift / n;
  double variance = 0.0;
  for (std::size_t k = 0; k < stack.order.size(); ++k) {
    const double depth = stack.depth_mm[k] - tilt.mean_depth_mm;
    tilt.slope += depth * (stack.shift_mm[k] - tilt.mean_shift_mm);
    variance += depth * depth;
  }
  tilt.slope /= variance;
  return tilt;
}

}  // namespace

void report_uneven(const std::vector<SlicePose>& slices, double tolerance, SliceStack& stack) {
  const Describer describe(slices, stack);
  const std::vector<GapGroup> groups = group_gaps(stack, tolerance);
  stack.least_spacing_mm = groups.front().mean_mm;
  const bool whole_steps = std::all_of(groups.begin(), groups.end(), [&](const GapGroup& group) {
    const double steps = group.mean_mm / stack.spacing_mm;
    return std::lround(steps) >= 1 && std::abs(steps - std::round(steps)) <= tolerance;
  });
  stack.irregular.push_back(whole_steps ? describe.missing(groups) : describe.uneven(groups));
}

void report_shifted(const std::vector<SlicePose>& slices, double tolerance_mm, SliceStack& stack) {
  const Describer describe(slices, stack);
  const Tilt tilt = fit_tilt(stack);
  std::size_t worst = 0;
  double worst_mm = 0.0;
  for (std::size_t k = 0; k < stack.order.size(); ++k) {
    const double off_mm = (stack.shift_mm[k] - tilt.mean_shift_mm -
                           tilt.slope * (stack.depth_mm[k] - tilt.mean_depth_mm))
                              .norm();
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
        "gantry tilt of " + format(std::atan(tilt.slope.norm()) / kDegree) + " degrees: from '" +
        describe.slice(0).name + "' to '" + describe.slice(stack.order.size() - 1).name +
        "' the slices shift sideways by " +
        format((stack.shift_mm.back() - stack.shift_mm.front()).norm()) + " mm");
}

}  // namespace usct::io
