#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "us_ct_registration/rendering/picture.h"

namespace usct {

/// Points of one colour, apart or joined by lines.
struct PlotSeries {
  /// In the legend; not there if empty.
  std::string name;
  std::vector<Eigen::Vector2d> points;
  bool joined = false;
};

/// Axes from 0 to `max`.
struct PlotAxes {
  std::string x_label;
  std::string y_label;
  double x_max = 1.0;
  double y_max = 1.0;
};

/// A plot with axes, ticks at round numbers, and a legend; each series in a colour of its own.
/// Points beyond the axes are drawn at their ends. Throws InputError if an axis' end is not finite
/// and > 0 or a point is not finite.
Picture plot(const PlotAxes& axes, const std::vector<PlotSeries>& series);

}  // namespace usct
