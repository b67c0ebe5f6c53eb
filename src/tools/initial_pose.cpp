#include "initial_pose.h"

#include <cstdio>

#include "landmark_warning.h"
#include "option_checks.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/registration/landmarks.h"
#include "us_ct_registration/registration/rough_pose.h"

namespace usct::tools {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

Isometry3d from_landmarks(const std::string& ct_path, const std::string& us_path,
                          const CtVolume& ct, const BeamGrid& beams) {
  const std::vector<Vector3d> points_ct = read_points_mm(ct_path);
  const std::vector<Vector3d> points_us = read_points_mm(us_path);
  const LandmarkAlignment alignment = align_landmarks(points_us, points_ct, us_path, ct_path);
  std::fprintf(stderr, "usct: landmarks: %zu pairs, RMS of what is left %.2f mm\n",
               points_ct.size(), alignment.residual_mm);
  warn_of_landmarks({ct_path, points_ct}, {us_path, points_us}, alignment.residual_mm);
  warn_of_places({ct_path, points_ct}, {us_path, points_us}, ct, beams);
  return alignment.T_target_source;
}

}  // namespace

void InitialPose::add_to(CLI::App& command) {
  CLI::App* group = command.add_option_group("Initial pose (one of)");
  CLI::Option* transform = group->add_option(
      "--initial", transform_, "ITK transform from US to CT points, mm, LPS (.tfm, .txt, .h5)");
  CLI::Option* landmarks = group->add_option(
      "--landmarks", landmarks_,
      "two CSV files x,y,z of the same points (3 at least), first in the CT (LPS mm), then in the "
      "US frame (mm)");
  CLI::Option* direction = group->add_option(
      "--probe-direction", probe_direction_,
      "where the beams (US axis y) and the lateral axis (x) point in the patient: two of left, "
      "right, anterior, posterior, superior, inferior; the middle of the CT then starts in the "
      "middle of the ultrasound");
  landmarks->expected(2)->excludes(transform)->excludes(direction);
  direction->expected(2)->excludes(transform)->check(
      one_of({"left", "right", "anterior", "posterior", "superior", "inferior"}));
}

Isometry3d InitialPose::T_us_ct(const CtVolume& ct, const BeamGrid& beams) const {
  if (!transform_.empty()) return read_T_us_ct(transform_);
  if (!landmarks_.empty()) return from_landmarks(landmarks_[0], landmarks_[1], ct, beams);
  if (probe_direction_.empty()) return rough_pose(ct.grid, beams, ProbeDirection{});
  return rough_pose(ct.grid, beams, parse_probe_direction(probe_direction_, "--probe-direction"));
}

}  // namespace usct::tools
