#pragma once

#include <functional>
#include <string>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/rendering/picture.h"

namespace usct::tools {

/// An image of samples x lines x frames to draw: the colour of the sample at an offset.
struct BeamImage {
  std::string title;
  std::function<Picture::Colour(std::size_t offset)> colour;
};

/// One frame as stored: lines to the right, samples downwards, square millimetres in the middle of
/// the depth range.
Picture beam_picture(const BeamImage& image, const BeamGrid& beams, int frame, double pixel_mm);

/// One frame scan-converted in its own plane, nearest sample; dark blue beside the fan.
Picture fan_picture(const BeamImage& image, const ScanGeometry& geometry, int frame,
                    double pixel_mm);

}  // namespace usct::tools
