#include "us_ct_registration/geometry/beam_grid.h"

#include <cmath>
#include <variant>

#include "require.h"

namespace usct {

void BeamGrid::validate(const std::string& source) const {
  require(samples() > 0, source, "samples", samples(), "> 0");
  require_positive(source, "spacing_mm", axial.spacing_mm);
  require(std::isfinite(axial.start_depth_mm), source, "start_depth_mm", axial.start_depth_mm,
          "finite");
  require(lines > 0, source, "lines", lines, "> 0");
  require(frames > 0, source, "frames", frames, "> 0");
  require(beams.size() == static_cast<std::size_t>(lines) * static_cast<std::size_t>(frames),
          source, "beams", static_cast<double>(beams.size()), "lines x frames");
  constexpr double kTolerance = 1e-3;
  for (std::size_t i = 0; i < beams.size(); ++i)
    if (!beams[i].origin_mm.allFinite() ||
        !(std::abs(beams[i].direction.norm() - 1.0) < kTolerance))
      throw InputError(source, "beam " + std::to_string(i) +
                                   " must have a finite origin and a direction of length 1");
}

Eigen::Vector3d BeamGrid::middle_mm() const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int frame = 0; frame < frames; ++frame)
    for (int line = 0; line < lines; ++line) sum += point(frame, line, 0.5 * (samples() - 1));
  return sum / (static_cast<double>(frames) * lines);
}

Eigen::AlignedBox3d BeamGrid::bounding_box() const {
  Eigen::AlignedBox3d box;
  for (int frame = 0; frame < frames; ++frame)
    for (int line = 0; line < lines; ++line)
      for (const int sample : {0, samples() - 1}) box.extend(point(frame, line, sample));
  return box;
}

BeamGrid beam_grid(const ScanGeometry& geometry) {
  geometry.validate("geometry");
  BeamGrid grid;
  grid.axial = geometry.axial;
  grid.lines = geometry.lines();
  grid.frames = geometry.frames();
  grid.tracked = std::holds_alternative<TrackedSweep>(geometry.motion);
  grid.beams.reserve(static_cast<std::size_t>(grid.lines) * static_cast<std::size_t>(grid.frames));
  for (int frame = 0; frame < grid.frames; ++frame)
    for (int line = 0; line < grid.lines; ++line) {
      const Eigen::Isometry3d T_us_frame = T_us_frame_of(geometry, frame, line);
      const Line l = line_in_frame(geometry.array, line);
      grid.beams.push_back({T_us_frame * l.origin_mm, T_us_frame.linear() * l.direction});
    }
  return grid;
}

BeamAxis parse_beam_axis(const std::string& text, const std::string& source) {
  const std::string axes = "xyz";
  if (text.size() == 2 && (text[0] == '+' || text[0] == '-') &&
      axes.find(text[1]) != std::string::npos)
    return {static_cast<int>(axes.find(text[1])), text[0] == '+'};
  throw InputError(source, "beam axis is '" + text + "', must be one of +x -x +y -y +z -z");
}

BeamGrid parallel_beam_grid(const Grid& grid, BeamAxis axis) {
  grid.validate("volume");
  if (axis.axis < 0 || axis.axis > 2)
    throw InputError("volume", "beam axis is " + std::to_string(axis.axis) + ", must be 0, 1 or 2");
  const int line_axis = axis.axis == 0 ? 1 : 0;
  const int frame_axis = axis.axis == 2 ? 1 : 2;
  BeamGrid beams;
  beams.axial = {grid.size[axis.axis], 0.0, grid.spacing_mm[axis.axis]};
  beams.lines = grid.size[line_axis];
  beams.frames = grid.size[frame_axis];
  const Eigen::Vector3d direction = (axis.positive ? 1.0 : -1.0) * grid.direction.col(axis.axis);
  beams.beams.reserve(static_cast<std::size_t>(beams.lines) *
                      static_cast<std::size_t>(beams.frames));
  for (int frame = 0; frame < beams.frames; ++frame)
    for (int line = 0; line < beams.lines; ++line) {
      Eigen::Vector3d index;
      index[axis.axis] = axis.positive ? 0 : grid.size[axis.axis] - 1;
      index[line_axis] = line;
      index[frame_axis] = frame;
      beams.beams.push_back({grid.physical_from_index(index), direction});
    }
  return beams;
}

}  // namespace usct
