#include "ultrasound/decimation.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "require.h"
#include "ultrasound/moving_place.h"

namespace usct {
namespace {

/// The mean of the beams of a block.
Beam mean_beam(const BeamGrid& beams, int first_frame, int first_line,
               const Eigen::Vector3i& factors) {
  Beam mean{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  for (int f = 0; f < factors.z(); ++f)
    for (int l = 0; l < factors.y(); ++l) {
      const Beam& beam = beams.beam(first_frame + f, first_line + l);
      mean.origin_mm += beam.origin_mm;
      mean.direction += beam.direction;
    }
  mean.origin_mm /= static_cast<double>(factors.y()) * factors.z();
  mean.direction.normalize();
  return mean;
}

/// Adds the known samples of one recorded line to the sums and counts of the blocks along it.
void add_line(const BeamUltrasound& in, std::size_t start, int factor, std::vector<float>& sum,
              std::vector<int>& count) {
  const float* values = in.brightness.data() + start;
  const std::uint8_t* known = in.known.empty() ? nullptr : in.known.data() + start;
  std::size_t i = 0;
  for (std::size_t block = 0; block < sum.size(); ++block)
    for (int s = 0; s < factor; ++s, ++i)
      if (known == nullptr || known[i] != 0) {
        sum[block] += values[i];
        ++count[block];
      }
}

int blocks_of(double step_mm, double spacing_mm, int available) {
  if (!(step_mm > 0.0)) return 1;
  const double factor = std::round(spacing_mm / step_mm);
  return static_cast<int>(std::clamp(factor, 1.0, std::max(1.0, std::floor(available / 2.0))));
}

}  // namespace

BeamUltrasound decimate(const BeamUltrasound& in, const Eigen::Vector3i& factors) {
  const BeamGrid& from = in.beams;
  const Eigen::Vector3i size(from.samples(), from.lines, from.frames);
  for (int axis = 0; axis < 3; ++axis)
    require(factors[axis] >= 1 && factors[axis] <= size[axis], "decimation", "factor",
            factors[axis], "within [1, " + std::to_string(size[axis]) + "]");
  if (factors == Eigen::Vector3i::Ones()) return in;

  BeamUltrasound out;
  out.beams.axial = {from.samples() / factors.x(), from.axial.depth_mm(0.5 * (factors.x() - 1)),
                     from.axial.spacing_mm * factors.x()};
  out.beams.lines = from.lines / factors.y();
  out.beams.frames = from.frames / factors.z();
  out.beams.tracked = from.tracked;
  out.beams.corrected_sweep = from.corrected_sweep;
  for (int f = 0; f < out.beams.frames; ++f)
    for (int l = 0; l < out.beams.lines; ++l)
      out.beams.beams.push_back(mean_beam(from, f * factors.z(), l * factors.y(), factors));

  const auto samples = static_cast<std::size_t>(out.beams.samples());
  out.brightness.resize(out.beams.beams.size() * samples);
  out.known.resize(out.brightness.size());
  parallel_for(out.beams.frames, [&](int f) {
    for (int l = 0; l < out.beams.lines; ++l) {
      std::vector<float> sum(samples);
      std::vector<int> count(samples);
      for (int df = 0; df < factors.z(); ++df)
        for (int dl = 0; dl < factors.y(); ++dl)
          add_line(in, from.offset(f * factors.z() + df, l * factors.y() + dl), factors.x(), sum,
                   count);
      const std::size_t start = out.beams.offset(f, l);
      for (std::size_t s = 0; s < samples; ++s) {
        const bool known = 2 * count[s] >= factors.prod();
        out.known[start + s] = known ? 1 : 0;
        out.brightness[start + s] = known ? sum[s] / static_cast<float>(count[s]) : 0.0F;
      }
    }
  });
  return out;
}

Eigen::Vector3i factors_for_spacing(const BeamGrid& beams, double spacing_mm) {
  require_positive("decimation", "spacing_mm", spacing_mm);
  const BeamSpacing step = mean_spacing_mm(beams);
  return {blocks_of(beams.axial.spacing_mm, spacing_mm, beams.samples()),
          blocks_of(step.line_mm, spacing_mm, beams.lines),
          blocks_of(step.frame_mm, spacing_mm, beams.frames)};
}

}  // namespace usct
