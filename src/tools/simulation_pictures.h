#pragma once

#include <functional>
#include <string>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/rendering/picture.h"

namespace usct::tools {

/// An image of samples x lines x frames, given by a function from the offset of a sample to its
/// colour.
struct BeamImage {
  std::string title;
  std::function<Picture::Colour(std::size_t offset)> colour;
};

/// One frame in index coordinates: lines to the right, samples downwards. A pixel is square in
/// millimetres at the middle of the depth range.
Picture beam_picture(const BeamImage& image, const BeamGrid& beams, int frame, double pixel_mm);

/// One frame scan-converted in its own plane, with nearest-neighbour interpolation; pixels beside
/// the fan are dark blue.
Picture fan_picture(const BeamImage& image, const ScanGeometry& geometry, int frame,
                    double pixel_mm);

}  // namespace usct::tools
