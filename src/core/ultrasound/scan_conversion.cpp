#include "us_ct_registration/ultrasound/scan_conversion.h"

#include <cmath>
#include <limits>

#include "parallel.h"
#include "ultrasound/lattice.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

/// Interpolates between the recorded samples of a pre-scan volume.
class PreScanSampler {
 public:
  PreScanSampler(const PreScanVolume& prescan, Interpolation interpolation)
      : voxels_(prescan.voxels.data()),
        samples_(prescan.geometry.samples()),
        lines_(prescan.geometry.lines()),
        frames_(prescan.geometry.frames()),
        nearest_(interpolation == Interpolation::kNearest) {}

  bool is_recorded(const ScanIndex& index) const {
    return usct::is_recorded(index.sample, samples_) && usct::is_recorded(index.line, lines_) &&
           usct::is_recorded(index.frame, frames_);
  }

  /// Brightness at an index within the recorded range.
  std::uint8_t at(const ScanIndex& index) const {
    const auto neighbours = [&](double i, int count) {
      return nearest_ ? Neighbours::nearest(i, count) : Neighbours::linear(i, count);
    };
    const Neighbours s = neighbours(index.sample, samples_);
    const Neighbours l = neighbours(index.line, lines_);
    const Neighbours f = neighbours(index.frame, frames_);
    const auto along_samples = [&](int line, int frame) {
      const std::uint8_t* voxels = voxels_ + (static_cast<std::ptrdiff_t>(frame) * lines_ + line) *
                                                 static_cast<std::ptrdiff_t>(samples_);
      return mix(voxels[s.lower], voxels[s.upper], s.weight);
    };
    const auto along_lines = [&](int frame) {
      return mix(along_samples(l.lower, frame), along_samples(l.upper, frame), l.weight);
    };
    return grey(mix(along_lines(f.lower), along_lines(f.upper), f.weight));
  }

 private:
  const std::uint8_t* voxels_;
  int samples_;
  int lines_;
  int frames_;
  bool nearest_;
};

/// Bounds of the field of a motorised sweep, with which voxels outside are skipped without
/// trigonometry.
struct SweepBounds {
  double phi_min;
  double phi_max;
  double H_min;
  double h_max;

  explicit SweepBounds(const ScanGeometry& geometry) {
    const auto& sweep = std::get<MotorSweep>(geometry.motion);
    const auto& array = std::get<CurvilinearArray>(geometry.array);
    const double travel = 0.5 * std::abs(sweep.frame_travel_rad);
    const double first = interpolate_table(sweep.frame_angles_rad, -0.5);
    const double last = interpolate_table(sweep.frame_angles_rad, geometry.frames() - 0.5);
    phi_min = std::min(first, last) - travel;
    phi_max = std::max(first, last) + travel;
    const double edge =
        std::max(std::abs(interpolate_table(array.line_angles_rad, -0.5)),
                 std::abs(interpolate_table(array.line_angles_rad, geometry.lines() - 0.5)));
    const double h_min = array.probe_radius_mm + geometry.axial.depth_mm(-0.5);
    h_max = array.probe_radius_mm + geometry.axial.depth_mm(geometry.samples() - 0.5);
    // With few lines, the angle half a line beyond the last may exceed 90 degrees, where the cosine
    // is negative.
    H_min = std::min(h_min * std::cos(edge), h_max * std::cos(edge));
  }
};

/// Fills the voxels of one slab of the grid.
class SlabConverter {
 public:
  SlabConverter(const PreScanVolume& prescan, Interpolation interpolation, ScanConverted& result)
      : inverse_(prescan.geometry),
        sampler_(prescan, interpolation),
        bounds_(prescan.geometry),
        grid_(result.volume.grid),
        result_(result) {}

  void convert(int k) const {
    const Eigen::Vector3d step = grid_.direction.col(0) * grid_.spacing_mm.x();
    const bool row_along_x = step.y() == 0.0 && step.z() == 0.0;
    for (int j = 0; j < grid_.size.y(); ++j) {
      const Eigen::Vector3d start = grid_.physical_from_index(Eigen::Vector3d(0, j, k));
      if (row_along_x) {
        convert_row_along_x(start, step.x(), grid_.offset(0, j, k));
        continue;
      }
      for (int i = 0; i < grid_.size.x(); ++i)
        fill(inverse_.scan_from_us(start + i * step), grid_.offset(i, j, k));
    }
  }

 private:
  /// Along a row parallel to x the motor angle is constant, and computed once.
  void convert_row_along_x(const Eigen::Vector3d& start, double step, std::size_t offset) const {
    const MotorisedInverse::Swing swing = inverse_.swing_from_us(start.y(), start.z());
    if (swing.phi_rad < bounds_.phi_min || swing.phi_rad > bounds_.phi_max) return;
    if (swing.H_mm < bounds_.H_min || swing.H_mm > bounds_.h_max) return;
    const double x_max = std::sqrt(bounds_.h_max * bounds_.h_max - swing.H_mm * swing.H_mm);
    for (int i = 0; i < grid_.size.x(); ++i) {
      const double x = start.x() + i * step;
      if (std::abs(x) <= x_max)
        fill(inverse_.scan_from_swing(swing, x), offset + static_cast<std::size_t>(i));
    }
  }

  void fill(const ScanIndex& index, std::size_t offset) const {
    if (!sampler_.is_recorded(index)) return;
    result_.volume.voxels[offset] = sampler_.at(index);
    result_.mask.voxels[offset] = 255;
  }

  MotorisedInverse inverse_;
  PreScanSampler sampler_;
  SweepBounds bounds_;
  const Grid& grid_;
  ScanConverted& result_;
};

}  // namespace

Eigen::AlignedBox3d field_of_view(const ScanGeometry& geometry) {
  geometry.validate("geometry");
  const std::vector<double> lines = bounding_indices(line_table(geometry.array));
  std::vector<double> frames;
  if (const auto* sweep = std::get_if<MotorSweep>(&geometry.motion))
    frames = bounding_indices(sweep->frame_angles_rad);
  else
    for (int frame = 0; frame < geometry.frames(); ++frame) frames.push_back(frame);
  Eigen::AlignedBox3d box;
  for (const double frame : frames)
    for (const double line : lines)
      for (const double sample : {-0.5, geometry.samples() - 0.5})
        box.extend(us_from_scan(geometry, {sample, line, frame}));
  return box;
}

Grid fan_grid(const ScanGeometry& geometry, double spacing_mm) {
  const Eigen::AlignedBox3d box = field_of_view(geometry);
  return grid_around_box(box.min(), box.max(), spacing_mm);
}

ScanConverted scan_convert(const PreScanVolume& prescan, const Grid& grid,
                           Interpolation interpolation, const Progress& progress) {
  prescan.validate("pre-scan volume");
  grid.validate("grid");
  if (!prescan.geometry.is_motorised())
    throw InputError("pre-scan volume", "is a tracked sweep, must be motorised (compound it)");
  ScanConverted result{UsVolume(grid), MaskVolume(grid)};
  const SlabConverter converter(prescan, interpolation, result);
  parallel_for(
      grid.size.z(), [&](int k) { converter.convert(k); }, progress);
  return result;
}

template <typename T>
std::vector<float> sample_along_beams(const Volume<T>& volume, const BeamGrid& beams,
                                      const Eigen::Isometry3d& T_volume_us,
                                      Interpolation interpolation, Outside outside,
                                      const Progress& progress) {
  const auto samples = static_cast<std::size_t>(beams.samples());
  std::vector<float> values(samples * beams.beams.size());
  const Eigen::Affine3d T_index_us = volume.grid.T_index_physical() * T_volume_us;
  parallel_for(
      beams.frames,
      [&](int frame) {
        float* value = values.data() + beams.offset(frame, 0);
        for (int line = 0; line < beams.lines; ++line) {
          const Eigen::Vector3d first = T_index_us * beams.point(frame, line, 0.0);
          const Eigen::Vector3d step =
              T_index_us.linear() * beams.beam(frame, line).direction * beams.axial.spacing_mm;
          for (int s = 0; s < beams.samples(); ++s)
            *value++ = sample_at_index(volume, first + s * step, interpolation, outside);
        }
      },
      progress);
  return values;
}

template std::vector<float> sample_along_beams(const Volume<std::uint8_t>&, const BeamGrid&,
                                               const Eigen::Isometry3d&, Interpolation, Outside,
                                               const Progress&);
template std::vector<float> sample_along_beams(const Volume<std::int16_t>&, const BeamGrid&,
                                               const Eigen::Isometry3d&, Interpolation, Outside,
                                               const Progress&);
template std::vector<float> sample_along_beams(const Volume<std::uint16_t>&, const BeamGrid&,
                                               const Eigen::Isometry3d&, Interpolation, Outside,
                                               const Progress&);
template std::vector<float> sample_along_beams(const Volume<float>&, const BeamGrid&,
                                               const Eigen::Isometry3d&, Interpolation, Outside,
                                               const Progress&);

}  // namespace usct
