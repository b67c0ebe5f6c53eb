#include "phantom/ct_anatomy.h"

#include <algorithm>
#include <cmath>

#include "phantom/ct_masks.h"
#include "phantom/scenes.h"
#include "phantom/signed_distance.h"
#include "random.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/volume/operations.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;

constexpr float kFatHu = -25.0F;
constexpr float kCorticalBoneHu = 450.0F;
constexpr double kHuSmoothingMm = 1.0;
/// Distance to objects outside the label map.
constexpr float kFarMm = 1e3F;

constexpr float kCortexMm = 7.0F;
constexpr float kSinusMm = 15.0F;
constexpr float kPerirenalMm = 18.0F;
constexpr double kTargetRadiusMm = 30.0;

}  // namespace

float CtAnatomy::LabelledTissue::at(const Vector3d& p) const {
  return sample(distance_mm, p, Interpolation::kTrilinear, Outside::constant(kFarMm));
}

CtAnatomy::CtAnatomy(std::uint64_t seed, const CtVolume& ct, const LabelVolume& labels,
                     const FromCtOptions& from_ct, const AnatomyOptions& options)
    : seed_(hash(seed, 0xC7A)),
      bone_hu_(static_cast<float>(from_ct.bone_hu)),
      hu_(smooth_gaussian(ct, Vector3d::Constant(kHuSmoothingMm), whole(ct.grid))),
      body_mm_(smooth_signed_distance(body_mask(ct), kBodyVoxelMm)) {
  for (const auto& [label, tissue] : from_ct.tissue_of_label) {
    MaskVolume mask = mask_of_label(labels, label);
    if (label == from_ct.kidney_label) set_kidney_centre(mask);
    labelled_.push_back(
        {label, tissue, smooth_signed_distance(mask, 0.8 * mask.grid.spacing_mm.maxCoeff())});
  }
  // The kidney to look at comes first: `find_surface` measures distances from it.
  std::stable_partition(labelled_.begin(), labelled_.end(),
                        [&](const LabelledTissue& t) { return t.label == from_ct.kidney_label; });
  if (from_ct.kidney_centre_mm) kidney_centre_mm_ = *from_ct.kidney_centre_mm;
  if (!holds(kidney_centre_mm_, 0.0))
    throw InputError("from-ct", "the kidney's centre lies outside the CT");
  find_surface(from_ct.kidney_label.has_value());
  place_bubbles(seed, options.bubbles);
}

Tissue CtAnatomy::tissue(const Vector3d& p) const {
  const float outside = depth_outside_mm(p);
  if (outside > 0.0F) return Tissue::kAir;
  const float hu = sample(hu_, p, Interpolation::kTrilinear, Outside::edge());
  float kidney_mm = kFarMm;
  for (const LabelledTissue& labelled : labelled_) {
    const float distance = labelled.at(p);
    if (labelled.tissue == Tissue::kCortex) {
      kidney_mm = std::min(kidney_mm, distance);
      if (distance < 0.0F) return inside_kidney(p, -distance, hu);
    } else if (distance < 0.0F) {
      return labelled.tissue;
    }
  }
  return by_hu(hu, -outside, kidney_mm);
}

Vector3d CtAnatomy::texture_point_mm(const Vector3d& p, Tissue) const {
  // Tissue near the skin lies in layers: its second coordinate is the depth.
  const float depth = -depth_outside_mm(p);
  return depth < 40.0F ? Vector3d(p.x() + p.y(), static_cast<double>(depth), p.z()) : p;
}

float CtAnatomy::depth_outside_mm(const Vector3d& p) const {
  return sample(body_mm_, p, Interpolation::kTrilinear, Outside::edge());
}

Vector3d CtAnatomy::skin_normal(const Vector3d& p) const {
  constexpr double kStepMm = 4.0;
  Vector3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d step = kStepMm * Vector3d::Unit(axis);
    gradient[axis] = static_cast<double>(depth_outside_mm(p + step) - depth_outside_mm(p - step));
  }
  return gradient.normalized();
}

bool CtAnatomy::holds(const Vector3d& p, double margin_mm) const {
  const Vector3d index = hu_.grid.index_from_physical(p);
  const Vector3d margin = margin_mm * hu_.grid.spacing_mm.cwiseInverse();
  return contains_index(hu_.grid, index - margin) && contains_index(hu_.grid, index + margin);
}

Tissue CtAnatomy::inside_kidney(const Vector3d& p, float depth_mm, float hu) const {
  if (hu >= bone_hu_ + 100.0F) return Tissue::kStone;
  if (hu < kFatHu) return Tissue::kSinusFat;
  if (depth_mm < kCortexMm) return Tissue::kCortex;
  if (depth_mm > kSinusMm) return Tissue::kSinusFat;
  return smooth_noise(hash(seed_, 1), p / 7.5) > -0.2 ? Tissue::kMedulla : Tissue::kCortex;
}

Tissue CtAnatomy::by_hu(float hu, float depth_mm, float kidney_mm) const {
  if (hu >= bone_hu_) return hu >= kCorticalBoneHu ? Tissue::kCorticalBone : Tissue::kSpongyBone;
  if (depth_mm < static_cast<float>(kSkinMm)) return Tissue::kSkin;
  if (hu < kAirHu) return Tissue::kGas;
  if (hu >= kFatHu) return Tissue::kSoftTissue;
  if (kidney_mm < kPerirenalMm) return Tissue::kPerirenalFat;
  return depth_mm < 25.0F ? Tissue::kSubcutaneousFat : Tissue::kFat;
}

void CtAnatomy::set_kidney_centre(const MaskVolume& mask) {
  Vector3d sum = Vector3d::Zero();
  double count = 0.0;
  for (int k = 0; k < mask.grid.size.z(); ++k)
    for (int j = 0; j < mask.grid.size.y(); ++j)
      for (int i = 0; i < mask.grid.size.x(); ++i)
        if (mask.at(i, j, k) != 0) {
          sum += Vector3d(i, j, k);
          count += 1.0;
        }
  kidney_centre_mm_ = mask.grid.physical_from_index(sum / count);
}

/// The outermost crossing of each ray from the centre; without labels, a sphere.
void CtAnatomy::find_surface(bool labelled) {
  for (const Vector3d& direction : even_directions(kTargetCount)) {
    if (!labelled) {
      surface_mm_.emplace_back(kidney_centre_mm_ + kTargetRadiusMm * direction);
      continue;
    }
    constexpr double kStepMm = 0.25;
    for (int step = 400; step > 0; --step)  // inwards from 100 mm
      if (labelled_.front().at(kidney_centre_mm_ + step * kStepMm * direction) < 0.0F) {
        surface_mm_.emplace_back(kidney_centre_mm_ + (step + 0.5) * kStepMm * direction);
        break;
      }
  }
}

void CtAnatomy::place_bubbles(std::uint64_t seed, int count) {
  Sequence random(seed, 0xB0B);
  for (int i = 0; i < count; ++i) {
    const std::size_t n = random.next() % surface_mm_.size();
    const double t = random.between(0.3, 0.8);
    balls_.push_back({kidney_centre_mm_ + t * (surface_mm_[n] - kidney_centre_mm_),
                      random.between(0.2, 0.8), Tissue::kGas});
  }
}

}  // namespace usct::phantom
