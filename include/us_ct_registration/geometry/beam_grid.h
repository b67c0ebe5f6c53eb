#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/grid.h"
#include "us_ct_registration/geometry/scan_geometry.h"

namespace usct {

/// One line of sight in the US frame; the sample at depth d lies at `origin_mm + d * direction`.
struct Beam {
  Eigen::Vector3d origin_mm;
  Eigen::Vector3d direction;  // unit length
};

/// Geometry of ultrasound as simulation and registration see it, whatever the probe: straight beams
/// with evenly spaced samples.
struct BeamGrid {
  AxialSampling axial;
  int lines = 0;
  int frames = 0;
  std::vector<Beam> beams;  // beams[frame * lines + line]
  /// Whether the poses of the frames come from a tracker, whose clock may differ from the images'.
  bool tracked = false;
  /// Whether the frames do not lie where they were recorded, but where images have shown.
  bool corrected_sweep = false;

  int samples() const { return axial.samples; }
  /// The number of a beam in `beams`.
  std::size_t beam_number(int frame, int line) const {
    return static_cast<std::size_t>(frame) * static_cast<std::size_t>(lines) +
           static_cast<std::size_t>(line);
  }
  const Beam& beam(int frame, int line) const { return beams[beam_number(frame, line)]; }
  /// The number of a sample where those of all beams follow each other, as in BeamUltrasound.
  std::size_t offset(int frame, int line, int sample = 0) const {
    return beam_number(frame, line) * static_cast<std::size_t>(samples()) +
           static_cast<std::size_t>(sample);
  }
  /// Position of a sample in the US frame, mm.
  Eigen::Vector3d point(int frame, int line, double sample) const {
    const Beam& b = beam(frame, line);
    return b.origin_mm + axial.depth_mm(sample) * b.direction;
  }

  /// Mean of the midpoints of all beams, US frame, mm.
  Eigen::Vector3d middle_mm() const;

  /// The box along the axes of the US frame, mm, that holds all samples.
  Eigen::AlignedBox3d bounding_box() const;

  /// Throws InputError, naming `source`, unless there is at least one sample, the number of beams
  /// equals lines x frames, all beams are finite and all directions have unit length.
  void validate(const std::string& source = "beam grid") const;
};

/// Variant B of the thesis: the true beams of a pre-scan acquisition. Throws InputError if the
/// geometry is invalid.
BeamGrid beam_grid(const ScanGeometry& geometry);

/// An index axis of a Cartesian volume and the sense in which sound travels along it.
struct BeamAxis {
  int axis = 1;          // 0, 1 or 2
  bool positive = true;  // towards rising indices
};

/// Parses "+x", "-y", ... (index axes). Throws InputError, naming `source`, for any other text.
BeamAxis parse_beam_axis(const std::string& text, const std::string& source);

/// Variant A of the thesis: parallel beams along an index axis of a Cartesian volume. The voxels
/// along the beam axis become the samples, those along the other two axes, in their order, the
/// lines and frames; the depth of the first sample is 0 and each beam starts at the centre of its
/// first voxel.
BeamGrid parallel_beam_grid(const Grid& grid, BeamAxis axis);

}  // namespace usct
