#include "ultrasound/moving_place.h"

#include <algorithm>
#include <vector>

namespace usct {
namespace {

struct MovingPlace {
  MeasuredPlace at;
  double path_mm = 0.0;
};

MovingPlace with_path(const BeamGrid& beams, const MeasuredPlace& at) {
  MovingPlace place{at};
  for (int frame = 1; frame < beams.frames; ++frame)
    place.path_mm +=
        (beams.point(frame, at.line, at.sample) - beams.point(frame - 1, at.line, at.sample))
            .norm();
  return place;
}

/// Mean distance between consecutive points.
template <typename PointAt>
double mean_step_mm(int count, const PointAt& point_at) {
  if (count < 2) return 0.0;
  double path_mm = 0.0;
  for (int i = 1; i < count; ++i) path_mm += (point_at(i) - point_at(i - 1)).norm();
  return path_mm / (count - 1);
}

}  // namespace

MeasuredPlace moving_place(const BeamGrid& beams) {
  constexpr int kParts = 4;
  constexpr double kFarther = 3.0;
  std::vector<MovingPlace> places;
  for (int l = 0; l <= kParts; ++l)
    for (int s = 0; s <= kParts; ++s)
      places.push_back(
          with_path(beams, {l * (beams.lines - 1) / kParts, s * (beams.samples() - 1.0) / kParts}));
  std::stable_sort(places.begin(), places.end(), [](const MovingPlace& a, const MovingPlace& b) {
    return a.path_mm < b.path_mm;
  });
  const MovingPlace& median = places[places.size() / 2];
  const MovingPlace middle = with_path(beams, {beams.lines / 2, 0.5 * (beams.samples() - 1)});
  return median.path_mm > kFarther * middle.path_mm ? median.at : middle.at;
}

BeamSpacing mean_spacing_mm(const BeamGrid& beams) {
  const double middle = 0.5 * (beams.samples() - 1);
  const MeasuredPlace place = moving_place(beams);
  return {mean_step_mm(beams.lines,
                       [&](int line) { return beams.point(beams.frames / 2, line, middle); }),
          mean_step_mm(beams.frames,
                       [&](int frame) { return beams.point(frame, place.line, place.sample); })};
}

}  // namespace usct
