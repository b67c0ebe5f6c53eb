#pragma once

#include <Eigen/Geometry>
#include <string>
#include <variant>
#include <vector>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/phantom/phantom.h"
#include "us_ct_registration/registration/registration.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

namespace usct::test {

/// Images in a known relative pose.
struct RegistrationCase {
  CtVolume ct;
  BeamUltrasound us;
  Eigen::Isometry3d T_us_ct_true = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> targets_us_mm;

  double error_mm(const Eigen::Isometry3d& T_us_ct) const {
    return evaluate_targets(T_us_ct, T_us_ct_true, targets_us_mm).mean_mm;
  }
};

/// A phantom with coarse images that show the whole kidney.
inline phantom::PhantomOptions small_phantom(phantom::SceneKind scene, phantom::SweepKind sweep) {
  phantom::PhantomOptions options;
  options.scene = scene;
  options.seed = 5;
  options.ct.size = {110, 90, 50};
  options.ct.spacing_mm = {1.4, 1.4, 2.0};
  options.sweep.kind = sweep;
  options.sweep.samples = 80;
  options.sweep.lines = 56;
  options.sweep.frames = 36;
  if (sweep == phantom::SweepKind::kMotorised) {
    options.sweep.samples = 110;
    options.sweep.lines = 64;
    options.sweep.frames = 44;
    options.sweep.lateral_fov_deg = 75.0;
    options.sweep.elevation_fov_deg = 55.0;
  }
  return options;
}

inline RegistrationCase case_of(const phantom::PhantomCase& phantom, const Ultrasound& us,
                                const BeamOptions& how = {}) {
  return {phantom.ct, beams_of(us, how).along, phantom.truth.T_us_ct, phantom.truth.targets_us_mm};
}

inline RegistrationCase make_case(const phantom::PhantomOptions& options) {
  const phantom::PhantomCase phantom = phantom::make_phantom(options);
  return case_of(phantom, phantom.ultrasound);
}

/// The case of a motorised sweep; made once.
inline const phantom::PhantomCase& agar_phantom() {
  static const phantom::PhantomCase agar = phantom::make_phantom(
      small_phantom(phantom::SceneKind::kAgar, phantom::SweepKind::kMotorised));
  return agar;
}
inline const RegistrationCase& agar_case() {
  static const RegistrationCase agar = case_of(agar_phantom(), agar_phantom().ultrasound);
  return agar;
}

/// A phantom whose motor angles are recorded too large by factors before and after the middle.
inline RegistrationCase slow_on_one_side(double before, double after) {
  PreScanVolume recorded = agar_phantom().ultrasound;
  for (double& angle_rad : std::get<MotorSweep>(recorded.geometry.motion).frame_angles_rad)
    angle_rad *= angle_rad < 0.0 ? before : after;
  return case_of(agar_phantom(), recorded);
}

/// The case of a tracked sweep; made once.
inline const phantom::PhantomCase& patient_phantom() {
  static const phantom::PhantomCase patient = phantom::make_phantom(
      small_phantom(phantom::SceneKind::kPatient, phantom::SweepKind::kTrackedCurvilinear));
  return patient;
}
inline const RegistrationCase& patient_case() {
  static const RegistrationCase patient = case_of(patient_phantom(), patient_phantom().ultrasound);
  return patient;
}

inline Eigen::Isometry3d rigid(const Eigen::Vector3d& rotation_vector_rad,
                               const Eigen::Vector3d& translation_mm) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const double angle_rad = rotation_vector_rad.norm();
  if (angle_rad > 0.0)
    T.linear() = Eigen::AngleAxisd(angle_rad, rotation_vector_rad / angle_rad).matrix();
  T.translation() = translation_mm;
  return T;
}

inline Eigen::Vector3d middle_us_mm(const RegistrationCase& images) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& target : images.targets_us_mm)
    middle += target / static_cast<double>(images.targets_us_mm.size());
  return middle;
}

/// The truth, turned about the middle of the targets and shifted, in the US frame.
inline Eigen::Isometry3d beside_truth(const RegistrationCase& images,
                                      const Eigen::Vector3d& rotation_vector_deg,
                                      const Eigen::Vector3d& translation_mm) {
  const Eigen::Translation3d to_middle(middle_us_mm(images));
  return to_middle * rigid(kDegree * rotation_vector_deg, translation_mm) * to_middle.inverse() *
         images.T_us_ct_true;
}

inline BeamUltrasound moved(BeamUltrasound us, const Eigen::Isometry3d& motion) {
  for (Beam& beam : us.beams.beams) {
    beam.origin_mm = motion * beam.origin_mm;
    beam.direction = motion.linear() * beam.direction;
  }
  return us;
}

inline CtVolume moved(CtVolume ct, const Eigen::Isometry3d& motion) {
  ct.grid.origin_mm = motion * ct.grid.origin_mm;
  ct.grid.direction = motion.linear() * ct.grid.direction;
  return ct;
}

/// The case with both images moved to other frames.
inline RegistrationCase moved(const RegistrationCase& images, const Eigen::Isometry3d& us_motion,
                              const Eigen::Isometry3d& ct_motion) {
  RegistrationCase result{moved(images.ct, ct_motion), moved(images.us, us_motion),
                          us_motion * images.T_us_ct_true * ct_motion.inverse(),
                          images.targets_us_mm};
  for (Eigen::Vector3d& target : result.targets_us_mm) target = us_motion * target;
  return result;
}

/// The preset for phantoms with one round of search; `changes` as in a file of options.
inline RegistrationOptions quick_options(const std::string& changes = "") {
  RegistrationOptions options = parse_registration_options("preset: phantom\n" + changes, "test");
  options.search.rounds = 1;
  return options;
}

/// A pose some millimetres and degrees beside the truth: 9.5 mm at the targets.
inline Eigen::Isometry3d nearby(const RegistrationCase& images, double sign = 1.0) {
  return beside_truth(images, sign * Eigen::Vector3d(5, -4, 6), sign * Eigen::Vector3d(6, -5, 4));
}

inline RegistrationResult registered(const RegistrationCase& images,
                                     const Eigen::Isometry3d& T_us_ct_initial,
                                     const RegistrationOptions& options = quick_options(),
                                     const RegistrationHooks& hooks = {}) {
  return register_ultrasound(images.us, images.ct, T_us_ct_initial, options, hooks);
}

}  // namespace usct::test
