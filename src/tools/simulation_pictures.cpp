#include "simulation_pictures.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace usct::tools {
namespace {

const Picture::Colour kBeside(12, 16, 40);

int pixels(double length_mm, double pixel_mm) {
  return std::max(1, static_cast<int>(std::lround(length_mm / pixel_mm)));
}

std::size_t offset(int sample, int line, int frame, int samples, int lines) {
  return (static_cast<std::size_t>(frame) * static_cast<std::size_t>(lines) +
          static_cast<std::size_t>(line)) *
             static_cast<std::size_t>(samples) +
         static_cast<std::size_t>(sample);
}

void put(Picture& picture, int x, int y, const Picture::Colour& colour) {
  std::copy_n(colour.data(), 3, picture.pixel(x, y));
}

}  // namespace

Picture beam_picture(const BeamImage& image, const BeamGrid& beams, int frame, double pixel_mm) {
  const int middle = beams.samples() / 2;
  double width_mm = beams.axial.spacing_mm;
  for (int line = 1; line < beams.lines; ++line)
    width_mm += (beams.point(frame, line, middle) - beams.point(frame, line - 1, middle)).norm();
  Picture picture(pixels(width_mm, pixel_mm),
                  pixels(beams.samples() * beams.axial.spacing_mm, pixel_mm));
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x)
      put(picture, x, y,
          image.colour(offset(y * beams.samples() / picture.height, x * beams.lines / picture.width,
                              frame, beams.samples(), beams.lines)));
  draw_text(picture, image.title, 6, 16);
  return picture;
}

Picture fan_picture(const BeamImage& image, const ScanGeometry& geometry, int frame,
                    double pixel_mm) {
  const int samples = geometry.samples();
  const int lines = geometry.lines();
  Eigen::AlignedBox2d box;
  for (int line = 0; line < lines; ++line) {
    const Line beam = line_in_frame(geometry.array, line);
    for (const double sample : {0.0, samples - 1.0}) {
      const Eigen::Vector3d p = beam.origin_mm + geometry.axial.depth_mm(sample) * beam.direction;
      box.extend(Eigen::Vector2d(p.x(), p.y()));
    }
  }
  const ArrayInverse inverse(geometry.array, geometry.axial);
  Picture picture(pixels(box.sizes().x(), pixel_mm), pixels(box.sizes().y(), pixel_mm));
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const ScanIndex index = inverse.scan_from_frame(
          {box.min().x() + (x + 0.5) * pixel_mm, box.min().y() + (y + 0.5) * pixel_mm, 0.0});
      const bool inside = index.sample >= -0.5 && index.sample < samples - 0.5 &&
                          index.line >= -0.5 && index.line < lines - 0.5;
      put(picture, x, y,
          inside ? image.colour(offset(static_cast<int>(std::floor(index.sample + 0.5)),
                                       static_cast<int>(std::floor(index.line + 0.5)), frame,
                                       samples, lines))
                 : kBeside);
    }
  draw_text(picture, image.title, 6, 16);
  return picture;
}

}  // namespace usct::tools
