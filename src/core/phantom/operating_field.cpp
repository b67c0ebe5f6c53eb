#include "phantom/operating_field.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "phantom/signed_distance.h"
#include "random.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/phantom/ct_formation.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;

constexpr double kSpacingMm = 0.6;
constexpr double kSmoothingMm = 0.5;
constexpr double kMarginMm = 24.0;
/// The bed lies this far behind the middle of the kidney; its bumps reach this far beyond.
constexpr double kBedDepthMm = 5.0;
constexpr double kBedBumpsMm = 12.0;
/// A ray that is nearer to a surface than this has met it.
constexpr double kTouchMm = 0.02;
constexpr double kLeastStepMm = 0.05;
constexpr int kMostMarchingSteps = 400;

/// The tissues that stay in view after the fat was taken away: the kidney, its lesions, its vessels
/// and the ureter.
bool is_exposed(Tissue tissue) {
  switch (tissue) {
    case Tissue::kCortex:
    case Tissue::kMedulla:
    case Tissue::kSinusFat:
    case Tissue::kArtery:
    case Tissue::kVein:
    case Tissue::kUrine:
    case Tissue::kTumour:
    case Tissue::kCyst:
    case Tissue::kStone:
      return true;
    default:
      return false;
  }
}

Grid grid_around(const std::vector<Vector3d>& points_mm) {
  Vector3d low = points_mm.front();
  Vector3d high = low;
  for (const Vector3d& p : points_mm) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Vector3d margin = Vector3d::Constant(kMarginMm);
  return grid_around_box(low - margin, high + margin, kSpacingMm);
}

template <typename Wanted>
Volume<float> distance_to(const LabelVolume& tissues, const Wanted& wanted) {
  MaskVolume mask(tissues.grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    mask.voxels[i] = wanted(static_cast<Tissue>(tissues.voxels[i])) ? 255 : 0;
  return smooth_signed_distance(mask, kSmoothingMm);
}

/// Distance to the surface of an object whose distances are known in a box; beyond the box, a lower
/// bound.
double distance_at(const Volume<float>& distances_mm, const Vector3d& p_mm) {
  const Grid& grid = distances_mm.grid;
  const Vector3d index = grid.index_from_physical(p_mm);
  const Vector3d last = (grid.size - Eigen::Vector3i::Ones()).cast<double>();
  const Vector3d inside = index.cwiseMax(Vector3d::Zero()).cwiseMin(last);
  const double beyond_mm = kSpacingMm * (index - inside).norm();
  const double there =
      sample_at_index(distances_mm, inside, Interpolation::kTrilinear, Outside::edge());
  return beyond_mm > 0.0 ? std::max(there - beyond_mm, beyond_mm) : there;
}

double rod_distance(const Rod& rod, const Vector3d& p_mm) {
  const Vector3d along = rod.to_mm - rod.from_mm;
  const double t = std::clamp((p_mm - rod.from_mm).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (p_mm - rod.from_mm - t * along).norm() - rod.radius_mm;
}

/// The unit gradient of a distance.
template <typename Distance>
Vector3d normal_of(const Distance& distance, const Vector3d& p_mm, double step_mm) {
  Vector3d normal;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d by = step_mm * Vector3d::Unit(axis);
    normal[axis] = distance(p_mm + by) - distance(p_mm - by);
  }
  return normal.normalized();
}

}  // namespace

OperatingField::OperatingField(const Scene& scene, std::uint64_t seed)
    : seed_(hash(seed, 0xE5D0)),
      centre_mm_(scene.kidney_centre_ct_mm),
      tissues_(form_labels(*scene.anatomy, grid_around(scene.kidney_surface_ct_mm))) {
  organ_mm_ = distance_to(tissues_, is_exposed);
  tumour_mm_ = distance_to(tissues_, [](Tissue tissue) { return tissue == Tissue::kTumour; });
  std::vector<Vector3d> tumour;
  const Eigen::Vector3i size = tissues_.grid.size;
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i)
        if (static_cast<Tissue>(tissues_.at(i, j, k)) == Tissue::kTumour)
          tumour.push_back(tissues_.grid.physical_from_index(Vector3d(i, j, k)));
  if (tumour.empty())
    throw InputError("endoscope", "there is no tumour in the anatomy, to which it could look");
  for (const Vector3d& p : tumour) tumour_centre_mm_ += p / static_cast<double>(tumour.size());
  for (const Vector3d& p : tumour)
    tumour_radius_mm_ = std::max(tumour_radius_mm_, (p - tumour_centre_mm_).norm() + kSpacingMm);
}

void OperatingField::lay_bed(const Vector3d& forward) { forward_ = forward; }

double OperatingField::organ_distance(const Vector3d& p_mm) const {
  return distance_at(organ_mm_, p_mm);
}

double OperatingField::bed_distance(const Vector3d& p_mm) const {
  const double above = -((p_mm - centre_mm_).dot(forward_) - kBedDepthMm);
  if (above > kBedBumpsMm + 2.0) return above - kBedBumpsMm;
  const double lobules = 2.6 * smooth_noise(seed_, p_mm / 22.0) +
                         0.9 * std::abs(smooth_noise(seed_ + 1, p_mm / 7.0)) +
                         0.25 * std::abs(smooth_noise(seed_ + 2, p_mm / 2.6));
  // The bumps make the surface steeper than its distance says; shorter steps do not jump over it.
  return 0.6 * (above - std::clamp(lobules, -kBedBumpsMm, kBedBumpsMm));
}

double OperatingField::tissue_distance(const Vector3d& p_mm) const {
  return std::min(organ_distance(p_mm), bed_distance(p_mm));
}

Tissue OperatingField::tissue_behind(const Vector3d& p_mm, const Vector3d& normal) const {
  if (bed_distance(p_mm) < organ_distance(p_mm)) return Tissue::kFat;
  for (const double depth_mm : {0.5, 1.0, 1.8}) {
    const auto tissue = static_cast<Tissue>(std::lround(
        sample(tissues_, p_mm - depth_mm * normal, Interpolation::kNearest, Outside::edge())));
    if (is_exposed(tissue)) return tissue;
  }
  return Tissue::kCortex;
}

std::optional<OperatingField::Hit> OperatingField::first_hit(const Sight& sight,
                                                             const std::vector<Rod>& rods,
                                                             double most_mm) const {
  double distance = 0.0;
  for (int step = 0; step < kMostMarchingSteps && distance < most_mm; ++step) {
    const Vector3d p = sight.at(distance);
    double nearest = tissue_distance(p);
    int rod = -1;
    for (std::size_t i = 0; i < rods.size(); ++i)
      if (const double to_rod = rod_distance(rods[i], p); to_rod < nearest) {
        nearest = to_rod;
        rod = static_cast<int>(i);
      }
    if (nearest > kTouchMm) {
      distance += std::max(nearest, kLeastStepMm);
      continue;
    }
    Hit hit{distance, {}, rod, Tissue::kAir};
    if (rod >= 0) {
      const Rod& touched = rods[static_cast<std::size_t>(rod)];
      hit.normal = normal_of([&](const Vector3d& q) { return rod_distance(touched, q); }, p, 0.01);
    } else {
      hit.normal = normal_of([&](const Vector3d& q) { return tissue_distance(q); }, p, 0.5);
      hit.tissue = tissue_behind(p, hit.normal);
    }
    return hit;
  }
  return std::nullopt;
}

bool OperatingField::meets_tumour(const Sight& sight) const {
  const double along = (tumour_centre_mm_ - sight.origin_mm).dot(sight.direction);
  if ((sight.at(along) - tumour_centre_mm_).norm() > tumour_radius_mm_) return false;
  double distance = along - tumour_radius_mm_;
  while (distance < along + tumour_radius_mm_) {
    const double nearest = distance_at(tumour_mm_, sight.at(distance));
    if (nearest <= 0.0) return true;
    distance += std::max(nearest, kLeastStepMm);
  }
  return false;
}

double OperatingField::openness(const Vector3d& p_mm, const Vector3d& normal) const {
  constexpr double kReachMm = 6.0;
  return std::clamp(tissue_distance(p_mm + kReachMm * normal) / kReachMm, 0.0, 1.0);
}

}  // namespace usct::phantom
