#pragma once

#include <cstdint>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/ultrasound/tracked_images.h"

namespace usct {

/// Resamples B-mode images of one size along the beams of the probe that made them, bilinearly. The
/// pixels and weights of each sample are computed once.
class ImageBeams {
 public:
  /// `shown` is as in TrackedImages. Throws InputError if the array, its sampling or its placement
  /// is invalid, or if no sample lies where the images show ultrasound.
  ImageBeams(int width, int height, const std::vector<std::uint8_t>& shown, const Array& array,
             const AxialSampling& axial, const ImagePlacement& placement);

  /// Number of samples of all lines.
  std::size_t size() const { return samples_.size(); }

  /// Reads `pixels`, width x height, columns fastest, and writes `brightness`, lines x samples,
  /// samples fastest. Samples that the image does not show are 0.
  void resample(const std::uint8_t* pixels, std::uint8_t* brightness) const;

 private:
  /// The four pixels around a sample; two of them coincide where its weight is 0.
  struct Sample {
    std::int64_t first = kNotShown;  // offset of the pixel with the lower column and row
    std::int32_t right = 0;          // offsets from there to the next column and row
    std::int32_t below = 0;
    float weight_right = 0.0F;
    float weight_below = 0.0F;
  };
  static constexpr std::int64_t kNotShown = -1;

  std::vector<Sample> samples_;
};

}  // namespace usct
