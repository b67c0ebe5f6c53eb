#include <algorithm>
#include <cmath>

#include "phantom/kidney.h"
#include "phantom/scenes.h"
#include "random.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

constexpr double kWallMm = 5.0;

/// A plastic box of agar; coordinates of the box: origin in the middle of the agar's surface, y
/// down. The CT is taken with the box on the table, surface up.
class AgarAnatomy : public Anatomy {
 public:
  AgarAnatomy(std::uint64_t seed, const AnatomyOptions& options)
      : kidney_(seed, KidneyContent{}), surface_seed_(hash(seed, 0x5F)) {
    Sequence random(seed, 0xA6A);
    depth_mm_ = random.between(92.0, 98.0);
    half_width_mm_ = random.between(95.0, 110.0);
    half_length_mm_ = random.between(68.0, 80.0);
    place_in_ct(random);
    place_kidney(random);
    place_fiducials(random, options.ball_diameter_mm);
    place_bubbles(random, options.bubbles);
  }

  Tissue tissue(const Vector3d& p_ct_mm) const override {
    const Vector3d p = T_box_ct_ * p_ct_mm;
    const double surface = 0.5 * smooth_noise(surface_seed_, p / 40.0);
    const double side =
        std::max(std::abs(p.x()) - half_width_mm_, std::abs(p.z()) - half_length_mm_);
    if (p.y() < surface || p.y() > depth_mm_ + kWallMm || side > kWallMm) return Tissue::kAir;
    if (p.y() > depth_mm_ || side > 0.0) return Tissue::kPlastic;
    const Vector3d q = T_kidney_box_ * p;
    if (q.squaredNorm() < 75.0 * 75.0)
      if (const auto found = kidney_.tissue(q)) return *found;
    return Tissue::kAgar;
  }

  const Isometry3d& T_box_ct() const { return T_box_ct_; }
  Isometry3d T_ct_kidney() const { return (T_kidney_box_ * T_box_ct_).inverse(); }
  const Kidney& kidney() const { return kidney_; }
  const std::vector<Vector3d>& fiducials_ct_mm() const { return fiducials_ct_mm_; }

 private:
  void place_in_ct(Sequence& random) {
    // Box y (down) is CT y (posterior): the surface faces up. The origin of a CT is arbitrary.
    const Vector3d origin(random.between(-60.0, 60.0), random.between(-120.0, -40.0),
                          random.between(-900.0, 300.0));
    const Isometry3d T_ct_box =
        Translation3d(origin) *
        AngleAxisd(random.between(-20.0, 20.0) * kDegree, Vector3d::UnitY()) *
        AngleAxisd(random.gaussian(0.0, 1.5) * kDegree, Vector3d::UnitX()) *
        AngleAxisd(random.gaussian(0.0, 1.5) * kDegree, Vector3d::UnitZ());
    T_box_ct_ = T_ct_box.inverse();
  }

  void place_kidney(Sequence& random) {
    // The kidney lies flat: long axis along x, thin axis (its z) vertical, hilum to one side.
    const double hilum_side = random.next() % 2 == 0 ? 1.0 : -1.0;
    Eigen::Matrix3d flat;
    flat.col(0) = Vector3d::UnitX();
    flat.col(1) = hilum_side * Vector3d::UnitZ();
    flat.col(2) = flat.col(0).cross(flat.col(1));
    const double depth = random.between(59.0, 63.0);
    const Isometry3d T_box_kidney =
        Translation3d(random.gaussian(0.0, 2.0), depth, random.gaussian(0.0, 2.0)) *
        AngleAxisd(random.gaussian(0.0, 8.0) * kDegree, Vector3d::UnitY()) *
        AngleAxisd(random.gaussian(0.0, 3.0) * kDegree, Vector3d::UnitZ()) *
        AngleAxisd(random.gaussian(0.0, 8.0) * kDegree, Vector3d::UnitX()) * Isometry3d(flat);
    T_kidney_box_ = T_box_kidney.inverse();
  }

  void place_fiducials(Sequence& random, double diameter_mm) {
    for (const auto& [x, z] : {std::pair(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
      const Vector3d p_box(x * random.between(14.0, 24.0), random.between(26.0, 31.0),
                           z * random.between(7.0, 13.0));
      fiducials_ct_mm_.push_back(T_box_ct_.inverse() * p_box);
      balls_.push_back({fiducials_ct_mm_.back(), 0.5 * diameter_mm, Tissue::kSteel});
    }
  }

  void place_bubbles(Sequence& random, int count) {
    // Air is trapped on the kidney's upper surface and in its vessels; some bubbles float in the
    // agar.
    for (int i = 0; i < count; ++i) {
      Vector3d direction = random.direction();
      const Vector3d up = T_kidney_box_.linear() * -Vector3d::UnitY();
      if (direction.dot(up) < 0.0) direction -= 2.0 * direction.dot(up) * up;
      const double depth = random.next() % 3 == 0 ? random.between(0.3, 1.25) : 1.01;
      const Vector3d p_kidney = depth * kidney_.surface_point_mm(direction);
      balls_.push_back({T_ct_kidney() * p_kidney, random.between(0.2, 0.8), Tissue::kGas});
    }
  }

  Kidney kidney_;
  std::uint64_t surface_seed_;
  double depth_mm_;
  double half_width_mm_;
  double half_length_mm_;
  Isometry3d T_box_ct_ = Isometry3d::Identity();
  Isometry3d T_kidney_box_ = Isometry3d::Identity();
  std::vector<Vector3d> fiducials_ct_mm_;
};

}  // namespace

Scene make_agar_scene(std::uint64_t seed, const AnatomyOptions& options) {
  const auto anatomy = std::make_shared<AgarAnatomy>(seed, options);
  Scene scene;
  scene.anatomy = anatomy;
  scene.tissues = TissueTable::ex_vivo()
                      .with_contrast(options.contrast)
                      .with_variation(options.tissue_variation, seed);
  Sequence random(seed, 0x9B0);
  const Isometry3d T_ct_box = anatomy->T_box_ct().inverse();
  const Isometry3d T_box_probe =
      Translation3d(random.gaussian(0.0, 3.0), -options.standoff_mm.value_or(1.0),
                    random.gaussian(0.0, 2.0)) *
      AngleAxisd(random.between(-15.0, 15.0) * kDegree, Vector3d::UnitY()) *
      AngleAxisd(random.gaussian(0.0, 3.0) * kDegree, Vector3d::UnitX()) *
      AngleAxisd(random.gaussian(0.0, 3.0) * kDegree, Vector3d::UnitZ());
  scene.T_ct_probe = T_ct_box * T_box_probe;
  const Isometry3d T_ct_kidney = anatomy->T_ct_kidney();
  scene.kidney_centre_ct_mm = T_ct_kidney.translation();
  for (const Vector3d& direction : even_directions(kTargetCount))
    scene.kidney_surface_ct_mm.push_back(T_ct_kidney *
                                         anatomy->kidney().surface_point_mm(direction));
  scene.fiducials_ct_mm = anatomy->fiducials_ct_mm();
  scene.ct_centre_mm = T_ct_box * Vector3d(0.0, 50.0, 0.0);
  scene.suggested_depth_mm = 95.0;
  scene.suggested_frequency_mhz = 5.0;
  return scene;
}

}  // namespace usct::phantom
