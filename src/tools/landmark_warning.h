#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace usct::tools {

/// Landmarks of one image, mm, and the file that they come from.
struct LandmarkFile {
  std::string path;
  std::vector<Eigen::Vector3d> points_mm;
};

/// Warns on standard error of landmarks that do not fit each other: whose fiducial registration
/// error is larger than 5 mm, which a start or a truth must not be, or that would fit far better in
/// another order, since those that lie close fit to a few mm in any. Warns of landmarks of one
/// image that lie so close that they can only be in metres.
void warn_of_landmarks(const LandmarkFile& ct, const LandmarkFile& us, double fre_mm);

}  // namespace usct::tools
