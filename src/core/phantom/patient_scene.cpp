#include <cmath>

#include "phantom/patient_anatomy.h"
#include "phantom/scenes.h"
#include "random.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector3d;

/// The direction, in the axial plane, in which a ray from a point inside is closest to the normal
/// of the skin, from 10 degrees in front of lateral to 50 behind.
double squarest_angle_deg(const PatientAnatomy& anatomy, const Vector3d& inside) {
  double best_angle = 0.0;
  double best_cosine = -1.0;
  for (int angle = -10; angle <= 50; angle += 2) {
    const Vector3d outwards(std::cos(angle * kDegree), std::sin(angle * kDegree), 0.0);
    const double cosine = outwards.dot(anatomy.skin_normal(anatomy.skin_point(inside, outwards)));
    if (cosine <= best_cosine) continue;
    best_cosine = cosine;
    best_angle = angle;
  }
  return best_angle;
}

/// Pose of the probe on the flank, between the last ribs and the pelvis.
Isometry3d probe_on_flank(const PatientAnatomy& anatomy, Sequence& random, double standoff_mm) {
  const Vector3d aim = anatomy.T_torso_kidney().translation() +
                       Vector3d(0.0, random.gaussian(0.0, 3.0), random.gaussian(-3.0, 4.0));
  const double backwards = (squarest_angle_deg(anatomy, aim) + random.between(-8.0, 8.0)) * kDegree;
  const double upwards = random.gaussian(3.0, 3.0) * kDegree;
  const Vector3d outwards(std::cos(backwards) * std::cos(upwards),
                          std::sin(backwards) * std::cos(upwards), -std::sin(upwards));
  const Vector3d contact = anatomy.skin_point(aim, outwards) + standoff_mm * outwards;
  const Vector3d along_kidney = anatomy.T_torso_kidney().linear().col(0);
  const Vector3d lateral =
      AngleAxisd(random.between(-15.0, 15.0) * kDegree, outwards) * along_kidney;
  Isometry3d T_ct_probe = Isometry3d::Identity();
  T_ct_probe.linear() = looking(-anatomy.ct_direction(outwards), anatomy.ct_direction(lateral));
  T_ct_probe.translation() = anatomy.ct_from_torso(contact);
  return T_ct_probe;
}

}  // namespace

Scene make_patient_scene(std::uint64_t seed, const AnatomyOptions& options) {
  const auto anatomy = std::make_shared<PatientAnatomy>(seed, options);
  Scene scene;
  scene.anatomy = anatomy;
  scene.tissues = TissueTable::patient()
                      .with_contrast(options.contrast)
                      .with_variation(options.tissue_variation, seed);
  Sequence random(seed, 0x9B0);
  const double standoff = random.between(3.0, 9.0);
  scene.T_ct_probe = probe_on_flank(*anatomy, random, options.standoff_mm.value_or(standoff));
  scene.kidney_centre_ct_mm = anatomy->ct_from_torso(anatomy->T_torso_kidney().translation());
  for (const Vector3d& direction : even_directions(kTargetCount))
    scene.kidney_surface_ct_mm.push_back(anatomy->ct_from_torso(
        anatomy->T_torso_kidney() * anatomy->kidney().surface_point_mm(direction)));
  scene.ct_centre_mm = scene.kidney_centre_ct_mm;
  scene.suggested_depth_mm = depth_that_shows_kidney_mm(scene);
  scene.surface_radius_mm = 95.0;
  scene.suggested_frequency_mhz = 3.5;
  return scene;
}

}  // namespace usct::phantom
