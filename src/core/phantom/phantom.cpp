#include "us_ct_registration/phantom/phantom.h"

#include <algorithm>
#include <cmath>

#include "phantom/check.h"
#include "phantom/deformation.h"
#include "phantom/echo_formation.h"
#include "phantom/receiver.h"
#include "phantom/scenes.h"
#include "phantom/stage.h"
#include "random.h"

namespace usct::phantom {
namespace {

using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

constexpr double kPatientIndentationMm = 4.0;

/// The rigid transform with the least sum of squared distances (Umeyama 1991, without scale).
Isometry3d best_rigid_fit(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to) {
  Eigen::Matrix3Xd source(3, from.size());
  Eigen::Matrix3Xd target(3, to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    source.col(static_cast<Eigen::Index>(i)) = from[i];
    target.col(static_cast<Eigen::Index>(i)) = to[i];
  }
  Isometry3d T = Isometry3d::Identity();
  T.matrix() = Eigen::umeyama(source, target, false);
  return T;
}

/// Mean displacement by breathing, in the probe frame, over the frames whose plane cuts the
/// kidney's surface; over all frames if none does.
Vector3d mean_breathing_mm(const Scene& scene, const Placement& placement,
                           const Acquisition& acquisition) {
  double sum_all = 0.0;
  double sum_cutting = 0.0;
  int cutting = 0;
  for (int f = 0; f < acquisition.truth.frames(); ++f) {
    const double here = acquisition.breathing_mm[static_cast<std::size_t>(f)];
    const Isometry3d T = T_frame_rest(placement, acquisition, f);
    int in_front = 0;
    for (const Vector3d& p : scene.kidney_surface_ct_mm)
      in_front += (T * placement.probe_from_ct(p)).z() > 0.0 ? 1 : 0;
    sum_all += here;
    if (in_front == 0 || in_front == static_cast<int>(scene.kidney_surface_ct_mm.size())) continue;
    sum_cutting += here;
    ++cutting;
  }
  const double mean = cutting > 0 ? sum_cutting / cutting : sum_all / acquisition.truth.frames();
  return mean * placement.T_probe_ct.linear().col(2);
}

PhantomTruth make_truth(const Scene& scene, const Placement& placement,
                        const Acquisition& acquisition, bool rigid) {
  PhantomTruth truth;
  const Vector3d breathing_mm = mean_breathing_mm(scene, placement, acquisition);
  const auto us_from_ct = [&](const Vector3d& p) -> Vector3d {
    return acquisition.T_us_probe * (placement.probe_from_ct(p) + breathing_mm);
  };
  truth.targets_ct_mm = scene.kidney_surface_ct_mm;
  truth.fiducials_ct_mm = scene.fiducials_ct_mm;
  for (const Vector3d& p : truth.targets_ct_mm) truth.targets_us_mm.push_back(us_from_ct(p));
  for (const Vector3d& p : truth.fiducials_ct_mm) truth.fiducials_us_mm.push_back(us_from_ct(p));
  truth.T_us_ct = rigid
                      ? acquisition.T_us_probe * Translation3d(breathing_mm) * placement.T_probe_ct
                      : best_rigid_fit(truth.targets_ct_mm, truth.targets_us_mm);
  double squares = 0.0;
  for (std::size_t i = 0; i < truth.targets_ct_mm.size(); ++i) {
    const double d = (truth.T_us_ct * truth.targets_ct_mm[i] - truth.targets_us_mm[i]).norm();
    squares += d * d;
    truth.max_residual_mm = std::max(truth.max_residual_mm, d);
  }
  truth.rms_residual_mm = std::sqrt(squares / static_cast<double>(truth.targets_ct_mm.size()));
  truth.geometry = acquisition.truth;
  truth.image_of_frame = acquisition.image_of_frame;
  truth.breathing_mm = acquisition.breathing_mm;
  return truth;
}

void scan(Scene scene, PhantomCase& phantom, const Progress& progress) {
  const PhantomOptions& options = phantom.options;
  const bool in_a_body = options.scene != SceneKind::kAgar;
  const double indentation_mm =
      options.anatomy.indentation_mm.value_or(in_a_body ? kPatientIndentationMm : 0.0);
  const double depth_mm = options.sweep.depth_mm.value_or(scene.suggested_depth_mm);
  const Acquisition acquisition =
      make_acquisition(options.sweep, depth_mm, scene.surface_radius_mm, options.seed);
  // The probe follows the skin that it indents.
  scene.T_ct_probe = scene.T_ct_probe * Translation3d(0.0, indentation_mm, 0.0);
  Placement placement;
  placement.T_probe_ct = scene.T_ct_probe.inverse();
  placement.deformation =
      Deformation(scene, options.anatomy.deformation_mm, indentation_mm, options.seed);
  const bool rigid = options.anatomy.deformation_mm == 0.0 && indentation_mm == 0.0;
  phantom.truth = make_truth(scene, placement, acquisition, rigid);
  phantom.ultrasound.geometry = acquisition.recorded;
  phantom.ultrasound.voxels = compress(
      form_echoes(scene, placement, acquisition, options.ultrasound, options.seed, progress),
      options.ultrasound);
}

}  // namespace

SceneKind parse_scene(const std::string& text, const std::string& source) {
  for (const SceneKind scene : {SceneKind::kAgar, SceneKind::kPatient, SceneKind::kFromCt})
    if (text == to_string(scene)) return scene;
  throw InputError(source, "scene is '" + text + "', must be agar, patient or from-ct");
}

std::string to_string(SceneKind scene) {
  switch (scene) {
    case SceneKind::kAgar:
      return "agar";
    case SceneKind::kPatient:
      return "patient";
    case SceneKind::kFromCt:
      return "from-ct";
  }
  return {};
}

Approach parse_approach(const std::string& text, const std::string& source) {
  for (const Approach approach :
       {Approach::kAuto, Approach::kLateral, Approach::kPosterior, Approach::kAnterior})
    if (text == to_string(approach)) return approach;
  throw InputError(source,
                   "approach is '" + text + "', must be auto, lateral, posterior or anterior");
}

std::string to_string(Approach approach) {
  switch (approach) {
    case Approach::kAuto:
      return "auto";
    case Approach::kLateral:
      return "lateral";
    case Approach::kPosterior:
      return "posterior";
    case Approach::kAnterior:
      return "anterior";
  }
  return {};
}

void PhantomOptions::validate() const {
  require_range("contrast", anatomy.contrast, 0.01, 1.5);
  require_range("tissue_variation", anatomy.tissue_variation, 0.0, 2.0);
  require_range("bubbles", anatomy.bubbles, 0, 200);
  require_range("ball_diameter_mm", anatomy.ball_diameter_mm, 0.5, 4.0);
  if (anatomy.standoff_mm) require_range("standoff_mm", *anatomy.standoff_mm, 0.0, 30.0);
  if (anatomy.indentation_mm) require_range("indentation_mm", *anatomy.indentation_mm, 0.0, 20.0);
  require_range("deformation_mm", anatomy.deformation_mm, 0.0, 15.0);
  ct.validate();
  sweep.validate();
  ultrasound.validate(sweep.lines);
  require_range("bone_hu", from_ct.bone_hu, 50.0, 3000.0);
  require_range("added_noise_hu", from_ct.added_noise_hu, 0.0, 200.0);
}

PhantomCase make_phantom(const PhantomOptions& options, const Progress& progress) {
  options.validate();
  if (options.scene == SceneKind::kFromCt)
    throw InputError("phantom options", "'scene' is from-ct, which needs a CT");
  const Scene scene = options.scene == SceneKind::kAgar
                          ? make_agar_scene(options.seed, options.anatomy)
                          : make_patient_scene(options.seed, options.anatomy);
  PhantomCase phantom;
  phantom.options = options;
  phantom.labels = form_labels(*scene.anatomy, ct_grid(options.ct, scene.ct_centre_mm),
                               stage(progress, 0.0, 0.15));
  phantom.ct = form_ct(*scene.anatomy, scene.tissues, phantom.labels, options.ct, options.seed,
                       stage(progress, 0.15, 0.4));
  scan(scene, phantom, stage(progress, 0.4, 1.0));
  return phantom;
}

PhantomCase make_phantom_from_ct(const CtVolume& ct, const LabelVolume& labels,
                                 const PhantomOptions& options, const Progress& progress) {
  options.validate();
  if (options.scene != SceneKind::kFromCt)
    throw InputError("phantom options",
                     "'scene' is " + to_string(options.scene) + ", must be from-ct with a CT");
  const Scene scene = make_ct_scene(options.seed, ct, labels, options.from_ct, options.anatomy);
  PhantomCase phantom;
  phantom.options = options;
  phantom.ct = ct;
  add_ct_noise(phantom.ct, options.from_ct.added_noise_hu, options.seed);
  phantom.labels = form_labels(*scene.anatomy, ct.grid, stage(progress, 0.1, 0.3));
  scan(scene, phantom, stage(progress, 0.3, 1.0));
  return phantom;
}

PhantomOptions made_hard(PhantomOptions options) {
  options.anatomy.contrast = 0.4;
  options.anatomy.bubbles = 15;
  options.ultrasound.penetration_mm = 80.0;
  options.ultrasound.clutter_db = -18.0;
  options.ultrasound.tgc_error_db = 3.0;
  options.ultrasound.lateral_gain_error_db = 3.0;
  options.ultrasound.sound_speed_error = 0.01;
  if (options.sweep.kind == SweepKind::kMotorised) {
    options.sweep.sweep_error = 1.0;
    options.sweep.elevation_fov_deg = 45.0;
  } else {
    options.sweep.pose_noise_mm = 0.5;
    options.sweep.pose_noise_deg = 0.4;
    options.sweep.lag_s = 0.2;
    options.sweep.duplicate_fraction = 0.15;
  }
  if (options.sweep.kind != SweepKind::kTrackedLinear) options.sweep.lateral_fov_deg = 55.0;
  return options;
}

}  // namespace usct::phantom
