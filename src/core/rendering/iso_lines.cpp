#include "rendering/iso_lines.h"

#include <algorithm>
#include <numeric>

namespace usct::rendering {
namespace {

/// The point at which the line crosses an edge between two neighbouring pixels. Both cells at the
/// edge give it the same number, which links their segments.
struct Crossing {
  std::size_t edge;
  cv::Point2d at;
};

struct LinkedSegment {
  std::size_t edge;
  Segment segment;
};

class MarchingSquares {
 public:
  MarchingSquares(const cv::Mat1f& values, const cv::Mat1b& known, float level)
      : values_(values), known_(known), level_(level), parent_(2 * values.total()) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    for (int y = 0; y + 1 < values.rows; ++y)
      for (int x = 0; x + 1 < values.cols; ++x)
        if (known(y, x) != 0 && known(y, x + 1) != 0 && known(y + 1, x) != 0 &&
            known(y + 1, x + 1) != 0)
          march(x, y);
  }

  std::vector<Segment> longer_than(double least_length_px) {
    std::vector<double> length_px(parent_.size(), 0.0);
    for (const auto& [edge, segment] : segments_)
      length_px[root(edge)] += cv::norm(segment.to - segment.from);
    std::vector<Segment> result;
    for (const auto& [edge, segment] : segments_)
      if (length_px[root(edge)] >= least_length_px) result.push_back(segment);
    return result;
  }

 private:
  bool above(int x, int y) const { return values_(y, x) >= level_; }

  /// The cell between pixels (x, y) and (x + 1, y + 1).
  void march(int x, int y) {
    std::vector<Crossing> crossings;
    const auto cross = [&](int x0, int y0, int x1, int y1) {
      if (above(x0, y0) != above(x1, y1)) crossings.push_back(crossing(x0, y0, x1, y1));
    };
    cross(x, y, x + 1, y);
    cross(x + 1, y, x + 1, y + 1);
    cross(x, y + 1, x + 1, y + 1);
    cross(x, y, x, y + 1);
    if (crossings.size() == 2) join(crossings[0], crossings[1]);
    if (crossings.size() < 4) return;
    // At a saddle, the mean decides which two of the corners are connected.
    const float mean =
        0.25F * (values_(y, x) + values_(y, x + 1) + values_(y + 1, x) + values_(y + 1, x + 1));
    const bool like_corner = (mean >= level_) == above(x, y);
    join(crossings[0], crossings[like_corner ? 1 : 3]);
    join(crossings[2], crossings[like_corner ? 3 : 1]);
  }

  Crossing crossing(int x0, int y0, int x1, int y1) const {
    const double t = (level_ - values_(y0, x0)) / (values_(y1, x1) - values_(y0, x0));
    const auto pixel = static_cast<std::size_t>(y0) * static_cast<std::size_t>(values_.cols) +
                       static_cast<std::size_t>(x0);
    return {2 * pixel + (y1 > y0 ? 1 : 0), {x0 + t * (x1 - x0), y0 + t * (y1 - y0)}};
  }

  void join(const Crossing& a, const Crossing& b) {
    segments_.push_back({a.edge, {a.at, b.at}});
    parent_[root(a.edge)] = root(b.edge);
  }

  std::size_t root(std::size_t edge) {
    while (parent_[edge] != edge) edge = parent_[edge] = parent_[parent_[edge]];
    return edge;
  }

  const cv::Mat1f& values_;
  const cv::Mat1b& known_;
  float level_;
  std::vector<std::size_t> parent_;  // of each edge, in a forest of connected lines
  std::vector<LinkedSegment> segments_;
};

}  // namespace

std::vector<Segment> iso_lines(const cv::Mat1f& values, const cv::Mat1b& known, float level,
                               double least_length_px) {
  return MarchingSquares(values, known, level).longer_than(least_length_px);
}

Threshold otsu_threshold(std::vector<float> values) {
  if (values.size() < 2) return {};
  std::sort(values.begin(), values.end());
  const auto count = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  double variance = 0.0;
  for (const float value : values) variance += (value - mean) * (value - mean) / count;
  Threshold best;
  double sum_below = 0.0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    sum_below += values[i - 1] - mean;
    const double below = static_cast<double>(i) / count;
    const double between = (sum_below / count) * (sum_below / count) / (below * (1.0 - below));
    if (between > best.separation * variance)
      best = {0.5 * (values[i - 1] + values[i]), between / variance, 1.0 - below};
  }
  return best;
}

}  // namespace usct::rendering
