#include "us_ct_registration/registration/similarity_profile.h"

#include "registration/images/image_pyramid.h"
#include "require.h"
#include "ultrasound/stray_frames.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

using namespace registration;
using Eigen::Isometry3d;
using Eigen::Vector3d;

template <typename T>
const T& or_error(const Outcome<T>& outcome) {
  if (!outcome) throw InputError("similarity profile", outcome.refusal().message);
  return *outcome;
}

/// The motion by `offset` along (0 to 2) or about (3 to 5) an axis of the US frame.
Isometry3d motion(int axis, double offset, const Vector3d& centre_us_mm) {
  const Vector3d direction = Vector3d::Unit(axis % 3);
  if (axis < 3) return Isometry3d(Eigen::Translation3d(offset * direction));
  return Isometry3d(Eigen::Translation3d(centre_us_mm) * Eigen::AngleAxisd(offset, direction) *
                    Eigen::Translation3d(-centre_us_mm));
}

}  // namespace

void ProfileOptions::validate(const std::string& source) const {
  require_positive(source, "reach_mm", reach_mm);
  require_positive(source, "reach_rad", reach_rad);
  require(steps >= 1, source, "steps", steps, ">= 1");
}

std::array<SimilarityProfile, 6> similarity_profiles(const BeamUltrasound& ultrasound,
                                                     const CtVolume& ct, const Isometry3d& T_us_ct,
                                                     const Vector3d& centre_us_mm,
                                                     const RegistrationOptions& options,
                                                     const ProfileOptions& profile) {
  profile.validate();
  const RegistrationHooks hooks;
  Run run(hooks);
  const FramesOnPath frames = frames_on_path(ultrasound);
  const BeamUltrasound& on_path = frames.others ? *frames.others : ultrasound;
  const Outcome<ImagePyramid> images = prepare({on_path, ct, T_us_ct, options}, run);
  const Level level = options.refinement
                          ? or_error(refinement_level(or_error(images), ct, T_us_ct, options))
                          : or_error(images).levels.back();
  std::array<SimilarityProfile, 6> profiles;
  for (int axis = 0; axis < 6; ++axis) {
    SimilarityProfile& of_axis = profiles[static_cast<std::size_t>(axis)];
    std::vector<SimilarityPose> poses;
    for (int step = -profile.steps; step <= profile.steps; ++step) {
      const double reach = axis < 3 ? profile.reach_mm : profile.reach_rad;
      of_axis.offsets.push_back(reach * step / profile.steps);
      poses.push_back(
          {(motion(axis, of_axis.offsets.back(), centre_us_mm) * T_us_ct).inverse(), {}});
    }
    for (const SimilarityValue& value : level.similarity->evaluate(poses))
      of_axis.values.push_back(value.value);
  }
  return profiles;
}

}  // namespace usct
