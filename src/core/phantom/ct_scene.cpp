#include <Eigen/Eigenvalues>
#include <cmath>
#include <utility>

#include "phantom/ct_anatomy.h"
#include "phantom/ct_masks.h"
#include "phantom/scenes.h"
#include "random.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom {
namespace {

using Eigen::AngleAxisd;
using Eigen::Vector3d;

struct View {
  Vector3d outwards;
  Vector3d contact_mm;
  double score = -1.0;
};

/// The path to the skin in a direction, and the share of the kidney's surface that sound reaches
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
  // A short path and a probe that lies flat on the skin also raise the score.
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
  // Lateral is the side, left or right, on which the skin is closer.
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
    throw InputError(kFromCt, "no skin in the CT from which a probe could see the kidney");
  // The aim is somewhat beside the best position, as with a probe held by a person.
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
  ct.grid.validate(kFromCt);
  if (from_ct.kidney_label.has_value() == from_ct.kidney_centre_mm.has_value())
    throw InputError(kFromCt, "needs either 'kidney_label' or 'kidney_centre_mm'");
  if (!from_ct.tissue_of_label.empty() && labels.voxels.empty())
    throw InputError(kFromCt, "'tissue_of_label' is set, but there is no label map");
  if (!from_ct.kidney_label) {
    if (from_ct.tissue_of_label.empty() && !labels.voxels.empty())
      throw InputError(kFromCt,
                       "a label map is given, but 'tissue_of_label' is empty: none of it counts");
    return;
  }
  const auto found = from_ct.tissue_of_label.find(*from_ct.kidney_label);
  if (found == from_ct.tissue_of_label.end() || found->second != Tissue::kCortex)
    throw InputError(kFromCt, "'tissue_of_label' of the kidney's label " +
                                  std::to_string(*from_ct.kidney_label) + " must be cortex");
}

}  // namespace

Scene make_ct_scene(std::uint64_t seed, const CtVolume& ct, const LabelVolume& labels,
                    const FromCtOptions& from_ct, const AnatomyOptions& options) {
  validate_input(ct, labels, from_ct);
  const auto anatomy = std::make_shared<CtAnatomy>(seed, ct, labels, from_ct, options);
  Scene scene;
  scene.anatomy = anatomy;
  scene.tissues = TissueTable::patient()
                      .with_contrast(options.contrast)
                      .with_variation(options.tissue_variation, seed);
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
  scene.suggested_depth_mm = depth_that_shows_kidney_mm(scene);
  scene.surface_radius_mm = 120.0;
  scene.suggested_frequency_mhz = 3.5;
  return scene;
}

}  // namespace usct::phantom
