#pragma once

#include <Eigen/Geometry>
#include <string>

#include "us_ct_registration/rendering/picture.h"
#include "us_ct_registration/rendering/slices.h"

/// Marks in panels and blocks of text, for people.
namespace usct::rendering {

/// Distance of texts from the edges of their picture.
constexpr int kMarginPx = 6;

struct TextStyle {
  double size = kCaptionSize;
  Picture::Colour ink{255, 255, 255};
  Picture::Colour background{30, 30, 30};
};

/// Distance of lines of text, pixels.
int line_px(double size = kCaptionSize);

/// A picture of a text, as high as its lines need, which are broken at `width` pixels.
Picture text_block(const std::string& text, int width, const TextStyle& style);

/// A coloured frame, and a word in the lower left corner.
void draw_frame(Picture& picture, const std::string& word, const Picture::Colour& colour,
                double size = kCaptionSize);

/// A bar in the lower right corner, as long as the largest of 5, 10, 20 and 50 mm that takes less
/// than a quarter of the width, with its length; nothing if 5 mm take more.
void draw_scale_bar(Picture& picture, double pixel_mm, double size);

/// The direction of the patient of a unit vector in the CT (LPS) in DICOM's letters: R, L, A, P, H,
/// F; two letters if it is more than 22.5 degrees from the axis of the first.
std::string patient_direction(const Eigen::Vector3d& direction_ct);

/// At the middle of each edge the direction of the patient towards which the picture goes there.
/// `T_us_ct` gives the patient's axes in the US frame.
void draw_patient_directions(Picture& picture, const SlicePlane& plane,
                             const Eigen::Isometry3d& T_us_ct, double size);

/// Ticks at the edges, where the two other planes through the point (US frame) cut this one.
void draw_ticks(Picture& picture, const SlicePlane& plane, const Eigen::Vector3d& centre_us_mm);

}  // namespace usct::rendering
