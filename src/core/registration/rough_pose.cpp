#include "us_ct_registration/registration/rough_pose.h"

#include <map>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

using Eigen::Vector3d;

Vector3d direction_of(const std::string& word, const std::string& source) {
  static const std::map<std::string, Vector3d> kDirections = {
      {"left", Vector3d::UnitX()},      {"right", -Vector3d::UnitX()},
      {"posterior", Vector3d::UnitY()}, {"anterior", -Vector3d::UnitY()},
      {"superior", Vector3d::UnitZ()},  {"inferior", -Vector3d::UnitZ()},
  };
  const auto found = kDirections.find(word);
  if (found == kDirections.end())
    throw InputError(source, "is '" + word +
                                 "', must be left, right, anterior, posterior, superior or "
                                 "inferior");
  return found->second;
}

}  // namespace

ProbeDirection parse_probe_direction(const std::vector<std::string>& words,
                                     const std::string& source) {
  if (words.size() != 2)
    throw InputError(source, "has " + std::to_string(words.size()) +
                                 " words, must have 2: where the axial and the lateral axis point");
  const ProbeDirection direction{direction_of(words[0], source), direction_of(words[1], source)};
  if (direction.axial.dot(direction.lateral) != 0.0)
    throw InputError(source,
                     "is " + words[0] + " " + words[1] + ", must be at right angles to each other");
  return direction;
}

Eigen::Isometry3d rough_pose(const Grid& ct, const BeamGrid& beams,
                             const ProbeDirection& direction) {
  Eigen::Matrix3d R_ct_us;
  R_ct_us << direction.lateral, direction.axial, direction.lateral.cross(direction.axial);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = R_ct_us.transpose();
  T.translation() = beams.middle_mm() - T.linear() * ct.centre_mm();
  return T;
}

}  // namespace usct
