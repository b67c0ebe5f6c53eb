#include "us_ct_registration/ultrasound/beam_ultrasound.h"

#include <atomic>
#include <cmath>

#include "parallel.h"
#include "require.h"

namespace usct {
namespace {

bool all_finite(const std::vector<float>& values) {
  std::atomic<bool> all{true};
  parallel_ranges(values.size(), [&](std::size_t begin, std::size_t end) {
    // The loop has no early exit, so that the compiler can vectorise it.
    int bad = 0;
    for (std::size_t i = begin; i < end; ++i) bad |= values[i] - values[i] == 0.0F ? 0 : 1;
    if (bad != 0) all = false;
  });
  return all;
}

}  // namespace

void BeamUltrasound::validate(const std::string& source) const {
  const std::size_t count = beams.beams.size() * static_cast<std::size_t>(beams.samples());
  require(count > 0, source, "samples", static_cast<double>(count), "> 0");
  require_positive(source, "spacing_mm", beams.axial.spacing_mm);
  require(brightness.size() == count, source, "brightness", static_cast<double>(brightness.size()),
          "one value per sample of the beam grid");
  require(known.empty() || known.size() == count, source, "known",
          static_cast<double>(known.size()), "empty or one value per sample of the beam grid");
  if (all_finite(brightness)) return;
  for (std::size_t i = 0; i < count; ++i)
    if (!std::isfinite(brightness[i]) && (known.empty() || known[i] != 0))
      require(false, source, "brightness", brightness[i], "finite");
}

BeamUltrasound along_beams(const PreScanVolume& volume) {
  volume.validate("pre-scan volume");
  return {beam_grid(volume.geometry), {volume.voxels.begin(), volume.voxels.end()}, {}};
}

BeamUltrasound along_beams(const UsVolume& volume, const MaskVolume& mask, BeamAxis axis) {
  volume.grid.validate("ultrasound");
  if (!mask.voxels.empty() && !same_grid(mask.grid, volume.grid))
    throw InputError("mask", "has another grid than the ultrasound, must have the same");
  BeamUltrasound result;
  result.beams = parallel_beam_grid(volume.grid, axis);
  const int line_axis = axis.axis == 0 ? 1 : 0;
  const int frame_axis = axis.axis == 2 ? 1 : 2;
  const int samples = result.beams.samples();
  for (int f = 0; f < result.beams.frames; ++f)
    for (int l = 0; l < result.beams.lines; ++l)
      for (int s = 0; s < samples; ++s) {
        Eigen::Vector3i index;
        index[axis.axis] = axis.positive ? s : samples - 1 - s;
        index[line_axis] = l;
        index[frame_axis] = f;
        const std::size_t offset = volume.grid.offset(index.x(), index.y(), index.z());
        result.brightness.push_back(volume.voxels[offset]);
        if (!mask.voxels.empty()) result.known.push_back(mask.voxels[offset]);
      }
  return result;
}

}  // namespace usct
