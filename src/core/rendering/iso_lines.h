#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace usct::rendering {

/// A segment in pixels; a pixel's centre has whole coordinates.
struct Segment {
  cv::Point2d from;
  cv::Point2d to;
};

/// The lines on which `values`, linear between pixels, equal `level` (marching squares), in squares
/// of which all four pixels are `known`. Connected lines of a total length below `least_length_px`
/// are noise and left out.
std::vector<Segment> iso_lines(const cv::Mat1f& values, const cv::Mat1b& known, float level,
                               double least_length_px);

/// The threshold that divides `values` into two classes with the largest variance between them
/// (Otsu 1979). `separation` is that variance as a fraction of the whole: 0.64 for a single normal
/// distribution, 0.75 for an even one, near 1 for two narrow ones.
struct Threshold {
  double value = 0.0;
  double separation = 0.0;
  /// The fraction of the values above the threshold.
  double above = 0.0;
};
Threshold otsu_threshold(std::vector<float> values);

}  // namespace usct::rendering
