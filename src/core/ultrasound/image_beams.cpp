#include "us_ct_registration/ultrasound/image_beams.h"

#include <algorithm>

#include "ultrasound/lattice.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

void validate(const Array& array, const AxialSampling& axial, const ImagePlacement& placement) {
  if (!placement.origin_px.allFinite() || !placement.spacing_mm.allFinite() ||
      (placement.spacing_mm.array() == 0.0).any())
    throw InputError("image placement", "origin and pixel size must be finite, pixel size not 0");
  ScanGeometry{axial, array, TrackedSweep{{Eigen::Isometry3d::Identity()}, {}}}.validate(
      "beams in images");
}

}  // namespace

ImageBeams::ImageBeams(int width, int height, const std::vector<std::uint8_t>& shown,
                       const Array& array, const AxialSampling& axial,
                       const ImagePlacement& placement) {
  validate(array, axial, placement);
  const auto is_shown = [&](std::int64_t pixel) {
    return shown.empty() || shown[static_cast<std::size_t>(pixel)] != 0;
  };
  for (int line = 0; line < line_count(array); ++line) {
    const Line l = line_in_frame(array, line);
    for (int sample = 0; sample < axial.samples; ++sample) {
      Sample& at = samples_.emplace_back();
      const Eigen::Vector3d p_mm = l.origin_mm + axial.depth_mm(sample) * l.direction;
      const Eigen::Vector2d pixel =
          placement.origin_px + p_mm.head<2>().cwiseQuotient(placement.spacing_mm);
      if (!(pixel.minCoeff() >= 0.0 && pixel.x() <= width - 1.0 && pixel.y() <= height - 1.0))
        continue;
      const Neighbours column = Neighbours::linear(pixel.x(), width);
      const Neighbours row = Neighbours::linear(pixel.y(), height);
      const std::int64_t first = static_cast<std::int64_t>(row.lower) * width + column.lower;
      const std::int32_t right = column.upper - column.lower;
      const std::int32_t below = (row.upper - row.lower) * width;
      if (is_shown(first) && is_shown(first + right) && is_shown(first + below) &&
          is_shown(first + below + right))
        at = {first, right, below, column.weight, row.weight};
    }
  }
  if (std::all_of(samples_.begin(), samples_.end(),
                  [](const Sample& sample) { return sample.first == kNotShown; }))
    throw InputError("image placement", "leaves every sample outside what the images show");
}

void ImageBeams::resample(const std::uint8_t* pixels, std::uint8_t* brightness) const {
  for (const Sample& sample : samples_) {
    float value = 0.0F;
    if (sample.first != kNotShown) {
      const std::uint8_t* upper = pixels + sample.first;
      const std::uint8_t* lower = upper + sample.below;
      value = mix(mix(upper[0], upper[sample.right], sample.weight_right),
                  mix(lower[0], lower[sample.right], sample.weight_right), sample.weight_below);
    }
    *brightness++ = grey(value);
  }
}

}  // namespace usct
