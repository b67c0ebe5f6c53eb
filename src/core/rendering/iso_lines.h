#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace usct::rendering {

/// In pixels; a pixel's centre has whole coordinates.
struct Segment {
  cv::Point2d from;
  cv::Point2d to;
};

/// Where `values`, linear between pixels, pass `level` (marching squares); only between pixels that
/// are all `known`. Lines shorter than `least_length_px` in all are left out: they are noise.
std::vector<Segment> iso_lines(const cv::Mat1f& values, const cv::Mat1b& known, float level,
                               double least_length_px);

/// A value between those of two kinds of pixels: it parts `values` so that the variance between
/// the parts is largest (Otsu 1979). `separation` is that variance as a fraction of the whole: 0.64
/// for a single normal distribution, 0.75 for an even one, near 1 for two narrow ones.
struct Threshold {
  double value = 0.0;
  double separation = 0.0;
  /// Fraction of the values above it.
  double above = 0.0;
};
Threshold otsu_threshold(std::vector<float> values);

}  // namespace usct::rendering
