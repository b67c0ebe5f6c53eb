#include "initial_pose.h"

#include <cstdio>
#include <map>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/points_io.h"
#include "us_ct_registration/io/transform_io.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct::tools {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// Directions of the patient in LPS.
const std::map<std::string, Vector3d> kDirections = {
    {"left", Vector3d::UnitX()},      {"right", -Vector3d::UnitX()},
    {"posterior", Vector3d::UnitY()}, {"anterior", -Vector3d::UnitY()},
    {"superior", Vector3d::UnitZ()},  {"inferior", -Vector3d::UnitZ()},
};

Isometry3d from_landmarks(const std::string& ct_path, const std::string& us_path) {
  const std::vector<Vector3d> points_ct = read_points_mm(ct_path);
  const std::vector<Vector3d> points_us = read_points_mm(us_path);
  if (points_ct.size() != points_us.size())
    throw InputError("--landmarks", ct_path + " has " + std::to_string(points_ct.size()) +
                                        " points and " + us_path + " has " +
                                        std::to_string(points_us.size()) + ", must be as many");
  const LandmarkAlignment alignment = align_landmarks(points_us, points_ct);
  std::fprintf(stderr, "usct: landmarks: %zu pairs, RMS of what is left %.2f mm\n",
               points_ct.size(), alignment.residual_mm);
  return alignment.T_target_source;
}

/// Rotation of a probe that looks along `axial`; both are directions of the patient.
Eigen::Matrix3d R_us_ct_of(const Vector3d& axial, const Vector3d& lateral) {
  Eigen::Matrix3d R_ct_us;
  R_ct_us << lateral, axial, lateral.cross(axial);
  return R_ct_us.transpose();
}

}  // namespace

void InitialPose::add_to(CLI::App& command) {
  CLI::App* group = command.add_option_group("Initial pose (one of)");
  CLI::Option* transform = group->add_option(
      "--initial", transform_, "ITK transform from US to CT points, mm, LPS (.tfm, .txt, .h5)");
  CLI::Option* landmarks = group->add_option(
      "--landmarks", landmarks_,
      "two CSV files x,y,z of the same points (3 at least) in the CT (LPS mm) and in the US frame "
      "(mm)");
  CLI::Option* direction = group->add_option(
      "--probe-direction", probe_direction_,
      "where the beams (US axis y) and the lateral axis (x) point in the patient: two of left, "
      "right, anterior, posterior, superior, inferior; the middle of the CT then starts in the "
      "middle of the ultrasound");
  landmarks->expected(2)->excludes(transform)->excludes(direction);
  direction->expected(2)->excludes(transform)->check(
      CLI::IsMember({"left", "right", "anterior", "posterior", "superior", "inferior"}));
}

Isometry3d InitialPose::T_us_ct(const CtVolume& ct, const BeamGrid& beams) const {
  if (!transform_.empty()) return read_T_us_ct(transform_);
  if (!landmarks_.empty()) return from_landmarks(landmarks_[0], landmarks_[1]);
  Vector3d axial = kDirections.at("posterior");
  Vector3d lateral = kDirections.at("left");
  if (!probe_direction_.empty()) {
    axial = kDirections.at(probe_direction_[0]);
    lateral = kDirections.at(probe_direction_[1]);
    if (axial.dot(lateral) != 0.0)
      throw InputError("--probe-direction", "is " + probe_direction_[0] + " " +
                                                probe_direction_[1] +
                                                ", must be at right angles to each other");
  }
  Isometry3d T = Isometry3d::Identity();
  T.linear() = R_us_ct_of(axial, lateral);
  T.translation() = middle_mm(beams) - T.linear() * ct.grid.centre_mm();
  return T;
}

Vector3d middle_mm(const BeamGrid& beams) {
  Vector3d sum = Vector3d::Zero();
  for (int frame = 0; frame < beams.frames; ++frame)
    for (int line = 0; line < beams.lines; ++line)
      sum += beams.point(frame, line, 0.5 * (beams.samples() - 1));
  return sum / (static_cast<double>(beams.frames) * beams.lines);
}

}  // namespace usct::tools
