#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "phantom/random.h"
#include "phantom/scenes.h"
#include "phantom/signed_distance.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/volume/operations.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::phantom {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr float kAirHu = -300.0F;
constexpr float kFatHu = -25.0F;
constexpr float kCorticalBoneHu = 450.0F;
constexpr double kHuSmoothingMm = 1.0;
constexpr double kBodyVoxelMm = 2.5;
constexpr float kFarMm = 1e3F;

constexpr double kSkinMm = 2.0;
constexpr float kCortexMm = 7.0F;
constexpr float kSinusMm = 15.0F;
constexpr float kPerirenalMm = 18.0F;
constexpr double kTargetRadiusMm = 30.0;

const char* const kSource = "from-ct";

/// Every n-th voxel so that voxels are about `spacing_mm` or as they are.
MaskVolume coarse_body_candidates(const CtVolume& ct) {
  const Vector3i step = (kBodyVoxelMm / ct.grid.spacing_mm.array()).round().max(1.0).cast<int>();
  Grid grid = ct.grid;
  grid.size = ((ct.grid.size.array() - 1) / step.array() + 1).matrix();
  grid.spacing_mm = ct.grid.spacing_mm.cwiseProduct(step.cast<double>());
  MaskVolume mask(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        mask.at(i, j, k) =
            static_cast<float>(ct.at(i * step.x(), j * step.y(), k * step.z())) > kAirHu ? 255 : 0;
  return mask;
}

/// Marks with `mark` all voxels of value `value` that connect to `seed` by faces; their number.
std::size_t flood(MaskVolume& mask, const Vector3i& seed, std::uint8_t value, std::uint8_t mark) {
  std::vector<Vector3i> front = {seed};
  mask.at(seed.x(), seed.y(), seed.z()) = mark;
  std::size_t count = 0;
  while (!front.empty()) {
    const Vector3i v = front.back();
    front.pop_back();
    ++count;
    for (int axis = 0; axis < 3; ++axis)
      for (const int step : {-1, 1}) {
        Vector3i n = v;
        n[axis] += step;
        if (n[axis] < 0 || n[axis] >= mask.grid.size[axis]) continue;
        std::uint8_t& m = mask.at(n.x(), n.y(), n.z());
        if (m != value) continue;
        m = mark;
        front.push_back(n);
      }
  }
  return count;
}

/// The body: the largest connected object that is not air, and all the air that it encloses in an
/// axial plane of the volume's edge (lungs, bowel).
MaskVolume body_mask(const CtVolume& ct) {
  MaskVolume mask = coarse_body_candidates(ct);
  const Vector3i& size = mask.grid.size;
  std::size_t largest = 0;
  Vector3i seed_of_largest = Vector3i::Zero();
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        if (mask.at(i, j, k) != 255) continue;
        const std::size_t count = flood(mask, {i, j, k}, 255, 1);
        if (count > largest) {
          largest = count;
          seed_of_largest = {i, j, k};
        }
      }
  if (largest < 1000)
    throw InputError(kSource, "the CT holds no body (no connected region above -300 HU)");
  flood(mask, seed_of_largest, 1, 2);
  for (std::uint8_t& m : mask.voxels) m = m == 2 ? 255 : 0;
  // Outer air touches the sides of the volume, not only its first and last axial slice (lungs do).
  const Vector3d up = mask.grid.direction.transpose() * Vector3d::UnitZ();
  int superior = 0;
  up.cwiseAbs().maxCoeff(&superior);
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        const Vector3i v(i, j, k);
        bool at_side = false;
        for (int axis = 0; axis < 3; ++axis)
          at_side |= axis != superior && (v[axis] == 0 || v[axis] == size[axis] - 1);
        if (at_side && mask.at(i, j, k) == 0) flood(mask, v, 0, 1);
      }
  for (std::uint8_t& m : mask.voxels) m = m == 1 ? 0 : 255;
  return mask;
}

MaskVolume mask_of_label(const LabelVolume& labels, int label) {
  std::vector<Vector3d> points;
  for (int k = 0; k < labels.grid.size.z(); ++k)
    for (int j = 0; j < labels.grid.size.y(); ++j)
      for (int i = 0; i < labels.grid.size.x(); ++i)
        if (labels.at(i, j, k) == label)
          points.push_back(labels.grid.physical_from_index(Vector3d(i, j, k)));
  if (points.empty())
    throw InputError(kSource, "label " + std::to_string(label) + " is not in the label map");
  const LabelVolume part = crop(labels, region_around(labels.grid, points, 30.0));
  MaskVolume mask(part.grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    mask.voxels[i] = part.voxels[i] == label ? 255 : 0;
  return mask;
}

struct LabelledTissue {
  int label;
  Tissue tissue;
  Volume<float> distance_mm;  // negative inside

  float at(const Vector3d& p) const {
    return sample(distance_mm, p, Interpolation::kTrilinear, Outside::constant(kFarMm));
  }
};

/// A real CT, its labels smoothed, what is left classified by HU.
class CtAnatomy : public Anatomy {
 public:
  CtAnatomy(std::uint64_t seed, const CtVolume& ct, const LabelVolume& labels,
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
    // The kidney asked for comes first: it is what distances are measured from.
    std::stable_partition(labelled_.begin(), labelled_.end(),
                          [&](const LabelledTissue& t) { return t.label == from_ct.kidney_label; });
    if (from_ct.kidney_centre_mm) kidney_centre_mm_ = *from_ct.kidney_centre_mm;
    if (!holds(kidney_centre_mm_, 0.0))
      throw InputError(kSource, "the kidney's centre lies outside the CT");
    find_surface(from_ct.kidney_label.has_value());
    Sequence random(seed, 0xB0B);
    for (int i = 0; i < options.bubbles; ++i) {
      const std::size_t n = random.next() % surface_mm_.size();
      const double t = random.between(0.3, 0.8);
      balls_.push_back({kidney_centre_mm_ + t * (surface_mm_[n] - kidney_centre_mm_),
                        random.between(0.2, 0.8), Tissue::kGas});
    }
  }

  Tissue tissue(const Vector3d& p) const override {
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

  Vector3d texture_point_mm(const Vector3d& p, Tissue) const override {
    // Layers below the skin: the second coordinate is the depth.
    const float depth = -depth_outside_mm(p);
    return depth < 40.0F ? Vector3d(p.x() + p.y(), static_cast<double>(depth), p.z()) : p;
  }

  float depth_outside_mm(const Vector3d& p) const {
    return sample(body_mm_, p, Interpolation::kTrilinear, Outside::edge());
  }
  /// Unit vector out of the body, near its surface.
  Vector3d skin_normal(const Vector3d& p) const {
    constexpr double kStepMm = 4.0;
    Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d step = kStepMm * Vector3d::Unit(axis);
      gradient[axis] = static_cast<double>(depth_outside_mm(p + step) - depth_outside_mm(p - step));
    }
    return gradient.normalized();
  }
  bool holds(const Vector3d& p, double margin_mm) const {
    const Vector3d index = hu_.grid.index_from_physical(p);
    const Vector3d margin = margin_mm * hu_.grid.spacing_mm.cwiseInverse();
    return contains_index(hu_.grid, index - margin) && contains_index(hu_.grid, index + margin);
  }
  const Vector3d& kidney_centre_mm() const { return kidney_centre_mm_; }
  const std::vector<Vector3d>& surface_mm() const { return surface_mm_; }

 private:
  Tissue inside_kidney(const Vector3d& p, float depth_mm, float hu) const {
    if (hu >= bone_hu_ + 100.0F) return Tissue::kStone;
    if (hu < kFatHu) return Tissue::kSinusFat;
    if (depth_mm < kCortexMm) return Tissue::kCortex;
    if (depth_mm > kSinusMm) return Tissue::kSinusFat;
    return smooth_noise(hash(seed_, 1), p / 7.5) > -0.2 ? Tissue::kMedulla : Tissue::kCortex;
  }

  Tissue by_hu(float hu, float depth_mm, float kidney_mm) const {
    if (hu >= bone_hu_) return hu >= kCorticalBoneHu ? Tissue::kCorticalBone : Tissue::kSpongyBone;
    if (depth_mm < static_cast<float>(kSkinMm)) return Tissue::kSkin;
    if (hu < kAirHu) return Tissue::kGas;
    if (hu >= kFatHu) return Tissue::kSoftTissue;
    if (kidney_mm < kPerirenalMm) return Tissue::kPerirenalFat;
    return depth_mm < 25.0F ? Tissue::kSubcutaneousFat : Tissue::kFat;
  }

  void set_kidney_centre(const MaskVolume& mask) {
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
  void find_surface(bool labelled) {
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

  std::uint64_t seed_;
  float bone_hu_;
  Volume<float> hu_;
  Volume<float> body_mm_;  // signed distance to the skin, negative inside
  std::vector<LabelledTissue> labelled_;
  Vector3d kidney_centre_mm_ = Vector3d::Zero();
  std::vector<Vector3d> surface_mm_;
};

struct View {
  Vector3d outwards;
  Vector3d contact_mm;
  double score = -1.0;
};

/// The way to the skin in a direction, and the share of the kidney's surface that sound reaches
/// from there without meeting bone or gas.
View view_from(const CtAnatomy& anatomy, const Vector3d& aim, const Vector3d& outwards,
               double standoff_mm) {
  View view{outwards, aim, -1.0};
  while (anatomy.depth_outside_mm(view.contact_mm) < 0.0F) {
    view.contact_mm += 0.25 * outwards;
    if (!anatomy.holds(view.contact_mm, 4.0)) return view;  // the CT ends within the body
  }
  const double length_mm = (view.contact_mm - aim).norm();
  const double tilt = 1.0 - outwards.dot(anatomy.skin_normal(view.contact_mm));
  view.contact_mm += standoff_mm * outwards;
  int free = 0;
  int rays = 0;
  for (std::size_t i = 0; i < anatomy.surface_mm().size(); i += 5, ++rays) {
    const Vector3d way = anatomy.surface_mm()[i] - view.contact_mm;
    const int steps = static_cast<int>(way.norm() / 1.5);
    bool blocked = false;
    for (int s = 0; s < steps && !blocked; ++s) {
      const Tissue t = anatomy.tissue(view.contact_mm + way * s / steps);
      blocked = is_strong_reflector(t) && t != Tissue::kAir;
    }
    free += blocked ? 0 : 1;
  }
  // A short way and a probe that lies flat on the skin count as well.
  view.score =
      std::max(0.0, static_cast<double>(free) / rays + 0.3 - 0.004 * length_mm - 1.5 * tilt);
  return view;
}

std::pair<int, int> angles_deg(Approach approach) {
  switch (approach) {
    case Approach::kLateral:
      return {-20, 20};
    case Approach::kPosterior:
      return {25, 85};
    case Approach::kAnterior:
      return {-85, -25};
    case Approach::kAuto:
      break;
  }
  return {-40, 85};
}

/// Angles run from lateral (0) to posterior (90) and anterior (-90).
View best_view(const CtAnatomy& anatomy, Approach approach, double standoff_mm, Sequence& random) {
  // The near side: where the skin is closer, left or right.
  const Vector3d& centre = anatomy.kidney_centre_mm();
  double side = 1.0;
  for (int step_mm = 0; step_mm < 400; ++step_mm) {
    const Vector3d aside_mm = step_mm * Vector3d::UnitX();
    const bool left = anatomy.depth_outside_mm(centre + aside_mm) > 0.0F;
    const bool right = anatomy.depth_outside_mm(centre - aside_mm) > 0.0F;
    if (!left && !right) continue;
    side = left ? 1.0 : -1.0;
    break;
  }
  const auto direction = [&](double angle_deg, double tilt_deg) {
    const double a = angle_deg * kDegree;
    const double b = tilt_deg * kDegree;
    return Vector3d(side * std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), std::sin(b));
  };
  const auto [first, last] = angles_deg(approach);
  View best;
  double best_angle = 0.0;
  double best_tilt = 0.0;
  for (int angle = first; angle <= last; angle += 5)
    for (const int tilt : {-24, -12, 0, 12}) {
      const View view = view_from(anatomy, centre, direction(angle, tilt), standoff_mm);
      if (view.score <= best.score) continue;
      best = view;
      best_angle = angle;
      best_tilt = tilt;
    }
  if (best.score < 0.0)
    throw InputError(kSource, "no skin in the CT from which a probe could see the kidney");
  // Nobody holds the probe at the very best place.
  const Vector3d aim =
      centre + Vector3d(random.gaussian(0, 3), random.gaussian(0, 3), random.gaussian(0, 4));
  const View held = view_from(
      anatomy, aim,
      direction(best_angle + random.gaussian(0.0, 3.0), best_tilt + random.gaussian(0.0, 3.0)),
      standoff_mm);
  return held.score > 0.7 * best.score ? held : best;
}

/// Direction in which the points spread most.
Vector3d long_axis(const std::vector<Vector3d>& points, const Vector3d& centre) {
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Vector3d& p : points) scatter += (p - centre) * (p - centre).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  Vector3d axis = solver.eigenvectors().col(2);
  return axis.z() < 0.0 ? Vector3d(-axis) : axis;
}

void validate_input(const CtVolume& ct, const LabelVolume& labels, const FromCtOptions& from_ct) {
  ct.grid.validate(kSource);
  if (from_ct.kidney_label.has_value() == from_ct.kidney_centre_mm.has_value())
    throw InputError(kSource, "needs either 'kidney_label' or 'kidney_centre_mm'");
  if (!from_ct.tissue_of_label.empty() && labels.voxels.empty())
    throw InputError(kSource, "'tissue_of_label' is set, but there is no label map");
  if (!from_ct.kidney_label) return;
  const auto found = from_ct.tissue_of_label.find(*from_ct.kidney_label);
  if (found == from_ct.tissue_of_label.end() || found->second != Tissue::kCortex)
    throw InputError(kSource, "'tissue_of_label' of the kidney's label " +
                                  std::to_string(*from_ct.kidney_label) + " must be cortex");
}

}  // namespace

Scene make_ct_scene(std::uint64_t seed, const CtVolume& ct, const LabelVolume& labels,
                    const FromCtOptions& from_ct, const AnatomyOptions& options) {
  validate_input(ct, labels, from_ct);
  const auto anatomy = std::make_shared<CtAnatomy>(seed, ct, labels, from_ct, options);
  Scene scene;
  scene.anatomy = anatomy;
  scene.tissues = TissueTable::patient().with_contrast(options.contrast);
  scene.kidney_centre_ct_mm = anatomy->kidney_centre_mm();
  scene.kidney_surface_ct_mm = anatomy->surface_mm();
  scene.ct_centre_mm = anatomy->kidney_centre_mm();
  Sequence random(seed, 0x9B0);
  const double standoff = options.standoff_mm.value_or(random.between(3.0, 9.0));
  const View view = best_view(*anatomy, from_ct.approach, standoff, random);
  const Vector3d axis = long_axis(scene.kidney_surface_ct_mm, scene.kidney_centre_ct_mm);
  scene.T_ct_probe.linear() = looking(
      -view.outwards, AngleAxisd(random.between(-15.0, 15.0) * kDegree, view.outwards) * axis);
  scene.T_ct_probe.translation() = view.contact_mm;
  double deepest = 0.0;
  for (const Vector3d& p : scene.kidney_surface_ct_mm)
    deepest = std::max(deepest, (scene.T_ct_probe.inverse() * p).y());
  scene.suggested_depth_mm = 5.0 * std::ceil((deepest + 28.0) / 5.0);
  scene.surface_radius_mm = 120.0;
  scene.suggested_frequency_mhz = 3.5;
  return scene;
}

}  // namespace usct::phantom
