#include "us_ct_registration/ultrasound/compounding.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "geometry/frame_times.h"
#include "parallel.h"
#include "ultrasound/lattice.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr double kCalibrationTolerance = 0.01;
/// Points per side of the square that a voxel averages over.
constexpr int kFinestFootprint = 8;

std::size_t product(int a, int b) {
  return static_cast<std::size_t>(a) * static_cast<std::size_t>(b);
}

/// Planes in space that hold values: what tracked sweeps and tracked images have in common.
/// Plane coordinates are two coordinates in the plane and the signed distance from it in mm.
class Planes {
 public:
  virtual ~Planes() = default;
  virtual int count() const = 0;
  virtual Eigen::Affine3d T_plane_us(int plane) const = 0;
  /// Millimetres per unit of the in-plane coordinates.
  virtual Eigen::Vector2d unit_mm(int plane) const = 0;
  /// Millimetres between recorded values, in the direction where they are closest.
  virtual double pitch_mm(int plane) const = 0;
  /// Everything known lies within these coordinates of a plane.
  virtual Eigen::AlignedBox2d bounds() const = 0;
  /// The value at a point of a plane, if known.
  virtual std::optional<float> at(int plane, double u, double v) const = 0;
};

class PreScanPlanes final : public Planes {
 public:
  explicit PreScanPlanes(const PreScanVolume& prescan)
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

  int count() const override { return geometry_.frames(); }
  Eigen::Affine3d T_plane_us(int plane) const override {
    return Eigen::Affine3d(T_us_frame_of(geometry_, plane, 0).inverse());
  }
  Eigen::Vector2d unit_mm(int) const override { return Eigen::Vector2d::Ones(); }
  double pitch_mm(int) const override { return geometry_.axial.spacing_mm; }
  Eigen::AlignedBox2d bounds() const override { return bounds_; }

  std::optional<float> at(int plane, double u, double v) const override {
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

 private:
  const PreScanVolume& prescan_;
  const ScanGeometry& geometry_;
  int samples_;
  int lines_;
  ArrayInverse inverse_;
  Eigen::AlignedBox2d bounds_;
};

class ImagePlanes final : public Planes {
 public:
  explicit ImagePlanes(const TrackedImages& images) : images_(images) {
    for (int row = 0; row < images.height; ++row)
      for (int column = 0; column < images.width; ++column)
        if (is_shown(column, row)) bounds_.extend(Eigen::Vector2d(column, row));
  }

  int count() const override { return images_.count(); }
  Eigen::Affine3d T_plane_us(int plane) const override {
    // The third column of the calibration is replaced by the unit normal: distances in mm.
    Eigen::Affine3d T = images_.T_us_pixel[static_cast<std::size_t>(plane)];
    T.matrix().col(2).head<3>() =
        T.matrix().col(0).head<3>().cross(T.matrix().col(1).head<3>()).normalized();
    return T.inverse();
  }
  Eigen::Vector2d unit_mm(int plane) const override {
    const auto& T = images_.T_us_pixel[static_cast<std::size_t>(plane)];
    return {T.linear().col(0).norm(), T.linear().col(1).norm()};
  }
  double pitch_mm(int plane) const override { return unit_mm(plane).minCoeff(); }
  Eigen::AlignedBox2d bounds() const override { return bounds_; }

  std::optional<float> at(int plane, double u, double v) const override {
    if (!(u >= 0.0 && v >= 0.0 && u <= images_.width - 1.0 && v <= images_.height - 1.0)) return {};
    const Neighbours c = Neighbours::linear(u, images_.width);
    const Neighbours r = Neighbours::linear(v, images_.height);
    for (const int column : {c.lower, c.upper})
      for (const int row : {r.lower, r.upper})
        if (!is_shown(column, row)) return {};
    const std::uint8_t* image = images_.pixels.data() + static_cast<std::size_t>(plane) *
                                                            product(images_.width, images_.height);
    const auto along_columns = [&](int row) {
      const std::uint8_t* pixels = image + product(row, images_.width);
      return mix(pixels[c.lower], pixels[c.upper], c.weight);
    };
    return mix(along_columns(r.lower), along_columns(r.upper), r.weight);
  }

 private:
  bool is_shown(int column, int row) const {
    return images_.shown.empty() ||
           images_.shown[product(row, images_.width) + static_cast<std::size_t>(column)] != 0;
  }

  const TrackedImages& images_;
  Eigen::AlignedBox2d bounds_;
};

/// A range of voxels [first, last] of a row; empty if first > last.
struct Range {
  double first;
  double last;

  /// Keeps the i with lowest <= start + i * step <= highest.
  void clip(double start, double step, double lowest, double highest) {
    if (step == 0.0) {
      if (start < lowest || start > highest) last = first - 1.0;
      return;
    }
    const double a = (lowest - start) / step;
    const double b = (highest - start) / step;
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
};

/// Compounds all planes into one slab of the grid, plane after plane.
class SlabCompounder {
 public:
  SlabCompounder(const Planes& planes, const CompoundOptions& options, ScanConverted& result)
      : planes_(planes),
        compounding_(options.compounding),
        half_thickness_mm_(0.5 * options.slice_thickness_mm),
        bounds_(planes.bounds()),
        result_(result) {
    const Grid& grid = result.volume.grid;
    for (int plane = 0; plane < planes.count(); ++plane) {
      T_plane_index_.push_back(planes.T_plane_us(plane) * grid.T_physical_index());
      const double side_mm = options.average_in_plane ? grid.spacing_mm.minCoeff() : 0.0;
      footprints_.push_back(footprint(side_mm, planes.pitch_mm(plane), planes.unit_mm(plane)));
    }
  }

  void compound(int k) const {
    const Eigen::Vector3i& size = result_.volume.grid.size;
    std::vector<Cell> cells(product(size.x(), size.y()));
    for (int plane = 0; plane < planes_.count(); ++plane)
      if (may_meet_slab(plane, k))
        for (int j = 0; j < size.y(); ++j)
          add_to_row(plane, j, k, cells.data() + product(j, size.x()));
    const std::size_t offset = result_.volume.grid.offset(0, 0, k);
    for (std::size_t n = 0; n < cells.size(); ++n) {
      if (!(cells[n].weight > 0.0F)) continue;
      result_.volume.voxels[offset + n] = grey(cells[n].sum / cells[n].weight);
      result_.mask.voxels[offset + n] = 255;
    }
  }

 private:
  struct Cell {
    float sum = 0.0F;
    float weight = 0.0F;
  };

  bool may_meet_slab(int plane, int k) const {
    const Eigen::Vector3i& size = result_.volume.grid.size;
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -lowest;
    for (const int i : {0, size.x() - 1})
      for (const int j : {0, size.y() - 1}) {
        const double distance =
            (T_plane_index_[static_cast<std::size_t>(plane)] * Eigen::Vector3d(i, j, k)).z();
        lowest = std::min(lowest, distance);
        highest = std::max(highest, distance);
      }
    return lowest < half_thickness_mm_ && highest > -half_thickness_mm_;
  }

  void add_to_row(int plane, int j, int k, Cell* row) const {
    const Eigen::Affine3d& T = T_plane_index_[static_cast<std::size_t>(plane)];
    const Eigen::Vector3d start = T * Eigen::Vector3d(0, j, k);
    const Eigen::Vector3d step = T.linear().col(0);
    Range range{0.0, result_.volume.grid.size.x() - 1.0};
    range.clip(start.z(), step.z(), -half_thickness_mm_, half_thickness_mm_);
    range.clip(start.x(), step.x(), bounds_.min().x(), bounds_.max().x());
    range.clip(start.y(), step.y(), bounds_.min().y(), bounds_.max().y());
    if (!(range.first <= range.last)) return;
    const int last = static_cast<int>(std::floor(range.last));
    for (int i = static_cast<int>(std::ceil(range.first)); i <= last; ++i) {
      const Eigen::Vector3d q = start + i * step;
      const auto weight = static_cast<float>(1.0 - std::abs(q.z()) / half_thickness_mm_);
      if (!(weight > 0.0F)) continue;
      if (const std::optional<float> value = average_around(plane, q.head<2>()))
        add(*value, weight, row[static_cast<std::size_t>(i)]);
    }
  }

  /// Points of a square around a voxel's place in the plane, relative to it, in its coordinates.
  static std::vector<Eigen::Vector2d> footprint(double side_mm, double pitch_mm,
                                                const Eigen::Vector2d& unit_mm) {
    const int n = std::clamp(static_cast<int>(std::ceil(side_mm / pitch_mm)), 1, kFinestFootprint);
    std::vector<Eigen::Vector2d> points;
    for (int b = 0; b < n; ++b)
      for (int a = 0; a < n; ++a)
        points.push_back(side_mm *
                         (Eigen::Vector2d(a + 0.5, b + 0.5) / n - Eigen::Vector2d::Constant(0.5))
                             .cwiseQuotient(unit_mm));
    return points;
  }

  /// The mean of what is known around a point that is known.
  std::optional<float> average_around(int plane, const Eigen::Vector2d& at) const {
    const std::vector<Eigen::Vector2d>& points = footprints_[static_cast<std::size_t>(plane)];
    const std::optional<float> middle = planes_.at(plane, at.x(), at.y());
    if (!middle || points.size() == 1) return middle;
    float sum = 0.0F;
    float count = 0.0F;
    for (const Eigen::Vector2d& point : points)
      if (const auto value = planes_.at(plane, at.x() + point.x(), at.y() + point.y())) {
        sum += *value;
        count += 1.0F;
      }
    return count > 0.0F ? sum / count : *middle;
  }

  void add(float value, float weight, Cell& cell) const {
    switch (compounding_) {
      case Compounding::kMean:
        cell.sum += weight * value;
        cell.weight += weight;
        return;
      case Compounding::kMaximum:
        cell.sum = std::max(cell.sum, value);
        cell.weight = 1.0F;
        return;
      case Compounding::kLatest:
        cell = {value, 1.0F};
        return;
    }
  }

  const Planes& planes_;
  Compounding compounding_;
  double half_thickness_mm_;
  Eigen::AlignedBox2d bounds_;
  std::vector<Eigen::Affine3d> T_plane_index_;
  std::vector<std::vector<Eigen::Vector2d>> footprints_;
  ScanConverted& result_;
};

/// One of each pair of opposite directions to the 26 neighbours.
std::vector<Eigen::Vector3i> half_of_the_neighbours() {
  std::vector<Eigen::Vector3i> directions;
  for (int k = 0; k <= 1; ++k)
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i)
        if (k > 0 || j > 0 || (j == 0 && i > 0)) directions.emplace_back(i, j, k);
  return directions;
}

/// Bridges gaps between known voxels (see CompoundOptions::hole_fill_radius_mm).
class HoleFiller {
 public:
  HoleFiller(const ScanConverted& known, double radius_mm) : known_(known) {
    for (const Eigen::Vector3i& step : half_of_the_neighbours()) {
      const double length_mm = step.cast<double>().cwiseProduct(grid().spacing_mm).norm();
      directions_.push_back({step, length_mm, static_cast<int>(radius_mm / length_mm)});
    }
  }

  /// The value across the hole at an empty voxel, if known voxels face each other there: over all
  /// directions the mean of the linear interpolations, weighted by the inverse of the gap's width.
  std::optional<float> at(const Eigen::Vector3i& voxel) const {
    double sum = 0.0;
    double weight = 0.0;
    for (const Direction& direction : directions_) {
      const std::optional<Known> ahead = nearest_known(voxel, direction, 1);
      if (!ahead) continue;
      const std::optional<Known> behind = nearest_known(voxel, direction, -1);
      if (!behind) continue;
      const double gap_mm = ahead->distance_mm + behind->distance_mm;
      sum += (ahead->value * behind->distance_mm + behind->value * ahead->distance_mm) /
             (gap_mm * gap_mm);
      weight += 1.0 / gap_mm;
    }
    if (!(weight > 0.0)) return {};
    return static_cast<float>(sum / weight);
  }

 private:
  struct Direction {
    Eigen::Vector3i step;
    double length_mm;
    int reach;  // steps
  };
  struct Known {
    double value;
    double distance_mm;
  };

  const Grid& grid() const { return known_.volume.grid; }

  std::optional<Known> nearest_known(const Eigen::Vector3i& voxel, const Direction& direction,
                                     int sense) const {
    for (int n = 1; n <= direction.reach; ++n) {
      const Eigen::Vector3i at = voxel + sense * n * direction.step;
      if ((at.array() < 0).any() || (at.array() >= grid().size.array()).any()) return {};
      const std::size_t offset = grid().offset(at.x(), at.y(), at.z());
      if (known_.mask.voxels[offset] != 0)
        return Known{static_cast<double>(known_.volume.voxels[offset]), n * direction.length_mm};
    }
    return {};
  }

  const ScanConverted& known_;
  std::vector<Direction> directions_;
};

ScanConverted with_holes_filled(const ScanConverted& known, double radius_mm) {
  ScanConverted filled = known;
  const HoleFiller filler(known, radius_mm);
  const Grid& grid = known.volume.grid;
  parallel_for(grid.size.z(), [&](int k) {
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        if (known.mask.at(i, j, k) != 0) continue;
        if (const std::optional<float> value = filler.at({i, j, k})) {
          filled.volume.at(i, j, k) = grey(*value);
          filled.mask.at(i, j, k) = 255;
        }
      }
  });
  return filled;
}

ScanConverted compound_planes(const Planes& planes, const Grid& grid,
                              const CompoundOptions& options, const Progress& progress) {
  grid.validate("grid");
  options.validate("compounding");
  ScanConverted result{UsVolume(grid), MaskVolume(grid)};
  const SlabCompounder compounder(planes, options, result);
  parallel_for(
      grid.size.z(), [&](int k) { compounder.compound(k); }, progress);
  if (options.hole_fill_radius_mm > 0.0)
    result = with_holes_filled(result, options.hole_fill_radius_mm);
  return result;
}

/// The rigid pose of frame coordinates that an image's calibration and its placement agree on.
Eigen::Isometry3d T_us_frame_of_image(const Eigen::Affine3d& T_us_pixel,
                                      const ImagePlacement& placement, int image) {
  const Eigen::Vector3d x = T_us_pixel.linear().col(0) / placement.spacing_mm.x();
  const Eigen::Vector3d y = T_us_pixel.linear().col(1) / placement.spacing_mm.y();
  if (std::abs(x.norm() - 1.0) > kCalibrationTolerance ||
      std::abs(y.norm() - 1.0) > kCalibrationTolerance ||
      std::abs(x.dot(y)) > kCalibrationTolerance)
    throw InputError("tracked images",
                     "image " + std::to_string(image) + " has pixels of " +
                         std::to_string(T_us_pixel.linear().col(0).norm()) + " x " +
                         std::to_string(T_us_pixel.linear().col(1).norm()) +
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
  const Eigen::Vector3d origin_px(placement.origin_px.x(), placement.origin_px.y(), 0.0);
  T.translation() = T_us_pixel * origin_px;
  return T;
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

void CompoundOptions::validate(const std::string& source) const {
  if (!std::isfinite(slice_thickness_mm) || slice_thickness_mm <= 0.0)
    throw InputError(source, "'slice_thickness_mm' is " + std::to_string(slice_thickness_mm) +
                                 ", must be finite and > 0");
  if (!std::isfinite(hole_fill_radius_mm) || hole_fill_radius_mm < 0.0)
    throw InputError(source, "'hole_fill_radius_mm' is " + std::to_string(hole_fill_radius_mm) +
                                 ", must be finite and >= 0");
}

ScanConverted compound(const PreScanVolume& prescan, const Grid& grid,
                       const CompoundOptions& options, const Progress& progress) {
  prescan.validate("pre-scan volume");
  if (prescan.geometry.is_motorised())
    throw InputError("pre-scan volume", "is motorised, must be tracked (scan-convert it)");
  return compound_planes(PreScanPlanes(prescan), grid, options, progress);
}

ScanConverted compound(const TrackedImages& images, const Grid& grid,
                       const CompoundOptions& options, const Progress& progress) {
  images.validate("tracked images");
  return compound_planes(ImagePlanes(images), grid, options, progress);
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

PreScanVolume prescan_from_images(const TrackedImages& images, const Array& array,
                                  const AxialSampling& axial, const ImagePlacement& placement) {
  images.validate("tracked images");
  if (!placement.origin_px.allFinite() || !placement.spacing_mm.allFinite() ||
      (placement.spacing_mm.array() == 0.0).any())
    throw InputError("image placement", "origin and pixel size must be finite, pixel size not 0");
  TrackedSweep sweep;
  for (int image = 0; image < images.count(); ++image)
    sweep.T_us_frame.push_back(
        T_us_frame_of_image(images.T_us_pixel[static_cast<std::size_t>(image)], placement, image));
  PreScanVolume prescan{{axial, array, sweep}, {}, {}};
  prescan.geometry.validate("tracked images");
  prescan.voxels.resize(product(prescan.geometry.samples(), prescan.geometry.lines()) *
                        static_cast<std::size_t>(images.count()));
  const ImagePlanes planes(images);
  bool any = false;
  for (int line = 0; line < prescan.geometry.lines(); ++line) {
    const Line l = line_in_frame(array, line);
    for (int sample = 0; sample < axial.samples; ++sample) {
      const Eigen::Vector3d p = l.origin_mm + axial.depth_mm(sample) * l.direction;
      const Eigen::Vector2d pixel =
          placement.origin_px + p.head<2>().cwiseQuotient(placement.spacing_mm);
      for (int image = 0; image < images.count(); ++image)
        if (const std::optional<float> value = planes.at(image, pixel.x(), pixel.y())) {
          prescan.voxels[prescan.offset(sample, line, image)] = grey(*value);
          any = true;
        }
    }
  }
  if (!any) throw InputError("image placement", "leaves every sample outside what the images show");
  return prescan;
}

}  // namespace usct
