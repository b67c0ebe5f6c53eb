#include "us_ct_registration/ultrasound/tracked_images.h"

#include <cmath>

#include "geometry/frame_times.h"
#include "ultrasound/planes.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/ultrasound/image_beams.h"

namespace usct {
namespace {

/// Tolerance between a calibration and the placement of the probe in its images: relative in scale,
/// and in the cosine of the angle between columns and rows.
constexpr double kCalibrationTolerance = 0.01;

std::size_t product(int a, int b) {
  return static_cast<std::size_t>(a) * static_cast<std::size_t>(b);
}

}  // namespace

void TrackedImages::validate(const std::string& source) const {
  const std::string size = std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (width < 1 || height < 1)
    throw InputError(source, "images have " + size + ", must have at least 1 x 1");
  if (T_us_pixel.empty()) throw InputError(source, "has no images, must have at least 1");
  const std::size_t per_image = product(width, height);
  if (pixels.size() != per_image * T_us_pixel.size())
    throw InputError(source, "holds " + std::to_string(pixels.size()) + " pixels, must hold " +
                                 std::to_string(T_us_pixel.size()) + " images of " + size);
  if (!shown.empty() && shown.size() != per_image)
    throw InputError(source, "'shown' has " + std::to_string(shown.size()) +
                                 " entries, must have none or one per pixel of " + size);
  if (!shown.empty() &&
      std::count(shown.begin(), shown.end(), 0) == static_cast<std::ptrdiff_t>(shown.size()))
    throw InputError(source, "'shown' is 0 everywhere, must be set for at least 1 pixel");
  for (std::size_t i = 0; i < T_us_pixel.size(); ++i) {
    const Eigen::Matrix3d linear = T_us_pixel[i].linear();
    const double area = linear.col(0).cross(linear.col(1)).norm();
    if (!T_us_pixel[i].matrix().allFinite() ||
        !(area > 1e-6 * linear.col(0).norm() * linear.col(1).norm()))
      throw InputError(source, "'T_us_pixel' of image " + std::to_string(i) +
                                   " must be finite, with columns and rows that span a plane");
  }
  require_frame_times(times_s, T_us_pixel.size(), source, "times_s");
}

std::vector<std::uint8_t> shown_rectangle(int width, int height, int first_column, int first_row,
                                          int columns, int rows) {
  if (first_column < 0 || first_row < 0 || columns < 1 || rows < 1 ||
      columns > width - first_column || rows > height - first_row)
    throw InputError("clip rectangle", "is " + std::to_string(columns) + " x " +
                                           std::to_string(rows) + " pixels from column " +
                                           std::to_string(first_column) + ", row " +
                                           std::to_string(first_row) + ", must lie within " +
                                           std::to_string(width) + " x " + std::to_string(height));
  std::vector<std::uint8_t> shown(product(width, height), 0);
  for (int row = first_row; row < first_row + rows; ++row)
    std::fill_n(shown.begin() + static_cast<std::ptrdiff_t>(row) * width + first_column, columns,
                std::uint8_t{255});
  return shown;
}

Grid image_grid(const TrackedImages& images, double spacing_mm) {
  images.validate("tracked images");
  const Eigen::AlignedBox2d shown = ImagePlanes(images).bounds();
  Eigen::AlignedBox3d box;
  for (const Eigen::Affine3d& T : images.T_us_pixel)
    for (const double u : {shown.min().x(), shown.max().x()})
      for (const double v : {shown.min().y(), shown.max().y()})
        box.extend(T * Eigen::Vector3d(u, v, 0.0));
  return grid_around_box(box.min(), box.max(), spacing_mm);
}

Eigen::Isometry3d array_pose(const Eigen::Affine3d& T_pixel, const ImagePlacement& placement,
                             const std::string& source) {
  const Eigen::Vector3d x = T_pixel.linear().col(0) / placement.spacing_mm.x();
  const Eigen::Vector3d y = T_pixel.linear().col(1) / placement.spacing_mm.y();
  if (!(std::abs(x.norm() - 1.0) <= kCalibrationTolerance &&
        std::abs(y.norm() - 1.0) <= kCalibrationTolerance &&
        std::abs(x.dot(y)) <= kCalibrationTolerance))
    throw InputError(source, "has pixels of " + std::to_string(T_pixel.linear().col(0).norm()) +
                                 " x " + std::to_string(T_pixel.linear().col(1).norm()) +
                                 " mm by its pose, with a cosine of " +
                                 std::to_string(x.normalized().dot(y.normalized())) +
                                 " between them, must be the placement's " +
                                 std::to_string(std::abs(placement.spacing_mm.x())) + " x " +
                                 std::to_string(std::abs(placement.spacing_mm.y())) +
                                 " mm and orthogonal within 1 %");
  Eigen::Matrix3d axes;
  axes << x, y, x.cross(y).normalized();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = svd.matrixU() * svd.matrixV().transpose();
  T.translation() =
      T_pixel * Eigen::Vector3d(placement.origin_px.x(), placement.origin_px.y(), 0.0);
  return T;
}

PreScanVolume prescan_from_images(const TrackedImages& images, const Array& array,
                                  const AxialSampling& axial, const ImagePlacement& placement) {
  images.validate("tracked images");
  const ImageBeams beams(images.width, images.height, images.shown, array, axial, placement);
  TrackedSweep sweep;
  for (int image = 0; image < images.count(); ++image)
    sweep.T_us_frame.push_back(array_pose(images.T_us_pixel[static_cast<std::size_t>(image)],
                                          placement,
                                          "tracked images: image " + std::to_string(image)));
  PreScanVolume prescan{{axial, array, sweep}, {}, {}};
  prescan.voxels.resize(beams.size() * sweep.T_us_frame.size());
  const std::size_t pixels = product(images.width, images.height);
  for (std::size_t image = 0; image < sweep.T_us_frame.size(); ++image)
    beams.resample(images.pixels.data() + image * pixels,
                   prescan.voxels.data() + image * beams.size());
  return prescan;
}

}  // namespace usct
