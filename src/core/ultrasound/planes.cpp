#include "ultrasound/planes.h"

#include "ultrasound/lattice.h"

namespace usct {

PreScanPlanes::PreScanPlanes(const PreScanVolume& prescan)
    : prescan_(prescan),
      geometry_(prescan.geometry),
      samples_(geometry_.samples()),
      lines_(geometry_.lines()),
      inverse_(geometry_.array, geometry_.axial) {
  for (const double line : bounding_indices(line_table(geometry_.array))) {
    const Line l = line_in_frame(geometry_.array, line);
    for (const double sample : {-0.5, samples_ - 0.5}) {
      const Eigen::Vector3d p = l.origin_mm + geometry_.axial.depth_mm(sample) * l.direction;
      bounds_.extend(p.head<2>());
    }
  }
}

Eigen::Affine3d PreScanPlanes::T_plane_us(int plane) const {
  return Eigen::Affine3d(T_us_frame_of(geometry_, plane, 0).inverse());
}

std::optional<float> PreScanPlanes::at(int plane, double u, double v) const {
  const ScanIndex index = inverse_.scan_from_frame(Eigen::Vector3d(u, v, 0.0));
  if (!is_recorded(index.sample, samples_) || !is_recorded(index.line, lines_)) return {};
  const Neighbours s = Neighbours::linear(index.sample, samples_);
  const Neighbours l = Neighbours::linear(index.line, lines_);
  const auto along_samples = [&](int line) {
    const std::uint8_t* voxels = prescan_.voxels.data() + prescan_.offset(0, line, plane);
    return mix(voxels[s.lower], voxels[s.upper], s.weight);
  };
  return mix(along_samples(l.lower), along_samples(l.upper), l.weight);
}

ImagePlanes::ImagePlanes(const TrackedImages& images) : images_(images) {
  for (int row = 0; row < images.height; ++row)
    for (int column = 0; column < images.width; ++column)
      if (is_shown(column, row)) bounds_.extend(Eigen::Vector2d(column, row));
}

Eigen::Affine3d ImagePlanes::T_plane_us(int plane) const {
  // The third column of the calibration is replaced by the unit normal, so that distances are in
  // mm.
  Eigen::Affine3d T = images_.T_us_pixel[static_cast<std::size_t>(plane)];
  T.matrix().col(2).head<3>() =
      T.matrix().col(0).head<3>().cross(T.matrix().col(1).head<3>()).normalized();
  return T.inverse();
}

Eigen::Vector2d ImagePlanes::unit_mm(int plane) const {
  const auto& T = images_.T_us_pixel[static_cast<std::size_t>(plane)];
  return {T.linear().col(0).norm(), T.linear().col(1).norm()};
}

std::optional<float> ImagePlanes::at(int plane, double u, double v) const {
  if (!(u >= 0.0 && v >= 0.0 && u <= images_.width - 1.0 && v <= images_.height - 1.0)) return {};
  const Neighbours c = Neighbours::linear(u, images_.width);
  const Neighbours r = Neighbours::linear(v, images_.height);
  for (const int column : {c.lower, c.upper})
    for (const int row : {r.lower, r.upper})
      if (!is_shown(column, row)) return {};
  const std::uint8_t* image =
      images_.pixels.data() + static_cast<std::size_t>(plane) * pixel(0, images_.height);
  const auto along_columns = [&](int row) {
    const std::uint8_t* pixels = image + pixel(0, row);
    return mix(pixels[c.lower], pixels[c.upper], c.weight);
  };
  return mix(along_columns(r.lower), along_columns(r.upper), r.weight);
}

}  // namespace usct
