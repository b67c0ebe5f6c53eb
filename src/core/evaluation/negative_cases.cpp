#include "evaluation/negative_cases.h"

#include <algorithm>
#include <cmath>

#include "random.h"
#include "require.h"
#include "ultrasound/moving_place.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/registration/landmarks.h"
#include "us_ct_registration/volume/operations.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kGreyPerDecibel = 255.0 / 60.0;
enum NegativePurpose : std::uint64_t { kSpeckle = 11, kApart };

std::vector<double> mean_grey_over_depth(const PreScanVolume& ultrasound) {
  const int samples = ultrasound.geometry.samples();
  const int lines = ultrasound.geometry.lines();
  const int frames = ultrasound.geometry.frames();
  std::vector<double> mean(static_cast<std::size_t>(samples), 0.0);
  for (int f = 0; f < frames; ++f)
    for (int l = 0; l < lines; ++l)
      for (int s = 0; s < samples; ++s)
        mean[static_cast<std::size_t>(s)] +=
            ultrasound.at(s, l, f) / (static_cast<double>(lines) * frames);
  return mean;
}

/// Samples, lines and frames as a regular grid with their mean spacing.
Grid grid_of_indices(const ScanGeometry& geometry) {
  constexpr double kLeastStepMm = 0.1;  // of a probe at rest: speckle is smoothed over many steps
  const BeamGrid beams = beam_grid(geometry);
  const BeamSpacing step = mean_spacing_mm(beams);
  Grid grid;
  grid.size = {beams.samples(), beams.lines, beams.frames};
  grid.spacing_mm = {beams.axial.spacing_mm, std::max(kLeastStepMm, step.line_mm),
                     std::max(kLeastStepMm, step.frame_mm)};
  return grid;
}

/// Amplitude of speckle in dB, minus its mean at each depth.
Volume<float> speckle_db(const Grid& grid, std::uint64_t seed, const SpeckleOptions& options) {
  const Vector3d sigma_mm(options.axial_mm, options.lateral_mm, options.elevation_mm);
  // Smoothing averages fewer samples at the ends of a volume; the margin keeps the ends outside.
  const Eigen::Vector3i margin =
      (3.0 * sigma_mm.cwiseQuotient(grid.spacing_mm)).array().ceil().cast<int>();
  Grid wider = grid;
  wider.size += 2 * margin;
  Volume<float> real(wider);
  Volume<float> imaginary(wider);
  Sequence random(seed, kSpeckle);
  for (std::size_t i = 0; i < real.voxels.size(); ++i) {
    const std::complex<double> pair = normal_pair(random.next());
    real.voxels[i] = static_cast<float>(pair.real());
    imaginary.voxels[i] = static_cast<float>(pair.imag());
  }
  real = smooth_gaussian(real, sigma_mm, {margin, grid.size});
  imaginary = smooth_gaussian(imaginary, sigma_mm, {margin, grid.size});
  std::vector<double> mean(static_cast<std::size_t>(grid.size.x()), 0.0);
  const double beams = static_cast<double>(grid.size.y()) * grid.size.z();
  for (std::size_t i = 0; i < real.voxels.size(); ++i) {
    const double amplitude = std::hypot(real.voxels[i], imaginary.voxels[i]);
    real.voxels[i] = static_cast<float>(20.0 * std::log10(std::max(amplitude, 1e-12)));
    mean[i % mean.size()] += real.voxels[i] / beams;
  }
  for (std::size_t i = 0; i < real.voxels.size(); ++i)
    real.voxels[i] -= static_cast<float>(mean[i % mean.size()]);
  return real;
}

struct BeamIndex {
  int frame;
  int line;
};

/// The acquisition with each beam's samples taken from the beam `source(frame, line)`.
template <typename Source>
PreScanVolume rearranged(const PreScanVolume& ultrasound, const Source& source) {
  ultrasound.validate("ultrasound");
  PreScanVolume result = ultrasound;
  for (int f = 0; f < ultrasound.geometry.frames(); ++f)
    for (int l = 0; l < ultrasound.geometry.lines(); ++l) {
      const BeamIndex beam = source(f, l);
      std::copy_n(ultrasound.voxels.begin() +
                      static_cast<std::ptrdiff_t>(ultrasound.offset(0, beam.line, beam.frame)),
                  ultrasound.geometry.samples(),
                  result.voxels.begin() + static_cast<std::ptrdiff_t>(result.offset(0, l, f)));
    }
  return result;
}

/// The same voxels with other directions of the index axes; the voxel at `centre_mm` stays there.
CtVolume turned_about(CtVolume ct, const Eigen::Matrix3d& direction, const Vector3d& centre_mm) {
  const Vector3d index = ct.grid.index_from_physical(centre_mm);
  ct.grid.direction = direction;
  ct.grid.origin_mm += centre_mm - ct.grid.physical_from_index(index);
  return ct;
}

struct Ball {
  Vector3d centre_mm;
  double radius_mm;
};

Ball ball_around(const Eigen::AlignedBox3d& box_mm) {
  return {box_mm.center(), 0.5 * box_mm.diagonal().norm()};
}

}  // namespace

PreScanVolume lines_reversed(const PreScanVolume& ultrasound) {
  const int last = ultrasound.geometry.lines() - 1;
  return rearranged(ultrasound, [last](int frame, int line) {
    return BeamIndex{frame, last - line};
  });
}

PreScanVolume frames_reversed(const PreScanVolume& ultrasound) {
  const int last = ultrasound.geometry.frames() - 1;
  return rearranged(ultrasound, [last](int frame, int line) {
    return BeamIndex{last - frame, line};
  });
}

Isometry3d half_turn(const ScanGeometry& ultrasound) {
  const BeamGrid beams = beam_grid(ultrasound);
  std::vector<Vector3d> before;
  std::vector<Vector3d> after;
  for (int f = 0; f < beams.frames; ++f)
    for (const int l : {0, beams.lines - 1})
      for (const int s : {0, beams.samples() - 1}) {
        before.push_back(beams.point(f, l, s));
        after.push_back(beams.point(beams.frames - 1 - f, beams.lines - 1 - l, s));
      }
  return align_landmarks(after, before).T_target_source;
}

CtVolume mirrored_ct(CtVolume ct, const Vector3d& centre_ct_mm) {
  Eigen::Matrix3d direction = ct.grid.direction;
  direction.row(0) *= -1.0;
  return turned_about(std::move(ct), direction, centre_ct_mm);
}

CtVolume axes_swapped_ct(CtVolume ct, const Vector3d& centre_ct_mm) {
  Eigen::Matrix3d direction = ct.grid.direction;
  direction.col(1).swap(direction.col(2));
  return turned_about(std::move(ct), direction, centre_ct_mm);
}

void SpeckleOptions::validate(const std::string& source) const {
  require_not_negative(source, "axial_mm", axial_mm);
  require_not_negative(source, "lateral_mm", lateral_mm);
  require_not_negative(source, "elevation_mm", elevation_mm);
}

PreScanVolume speckle_only(const PreScanVolume& ultrasound, std::uint64_t seed,
                           const SpeckleOptions& options) {
  ultrasound.validate("ultrasound");
  options.validate("speckle");
  const std::vector<double> profile = mean_grey_over_depth(ultrasound);
  const Volume<float> speckle = speckle_db(grid_of_indices(ultrasound.geometry), seed, options);
  PreScanVolume result = ultrasound;
  for (std::size_t i = 0; i < result.voxels.size(); ++i) {
    const double grey = profile[i % profile.size()] + kGreyPerDecibel * speckle.voxels[i];
    result.voxels[i] = static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
  }
  return result;
}

Isometry3d pose_of_other_ct(const Isometry3d& T_us_ct, const Vector3d& centre_us_mm,
                            const Vector3d& centre_other_ct_mm) {
  Isometry3d T_us_other = T_us_ct;
  T_us_other.translation() = centre_us_mm - T_us_ct.linear() * centre_other_ct_mm;
  return T_us_other;
}

Isometry3d moved_apart(const Isometry3d& T_us_ct, const Grid& ct, const ScanGeometry& ultrasound,
                       double gap_mm, std::uint64_t seed) {
  Eigen::AlignedBox3d ct_box;
  for (int corner = 0; corner < 8; ++corner)
    ct_box.extend(T_us_ct *
                  ct.physical_from_index(Vector3d((corner & 1) != 0 ? ct.size.x() - 1 : 0,
                                                  (corner & 2) != 0 ? ct.size.y() - 1 : 0,
                                                  (corner & 4) != 0 ? ct.size.z() - 1 : 0)));
  const Ball ct_ball = ball_around(ct_box);
  const Ball us_ball = ball_around(beam_grid(ultrasound).bounding_box());
  const Vector3d direction = Sequence(seed, kApart).direction();
  const double distance_mm = ct_ball.radius_mm + us_ball.radius_mm + gap_mm;
  return Eigen::Translation3d(us_ball.centre_mm + distance_mm * direction - ct_ball.centre_mm) *
         T_us_ct;
}

}  // namespace usct
