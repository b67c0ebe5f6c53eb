#pragma once

#include <Eigen/Core>
#include <vector>

namespace usct {

/// The mean of the points. Throws InputError, naming "targets", if there is no point or one is not
/// finite.
Eigen::Vector3d centroid(const std::vector<Eigen::Vector3d>& points_mm);

}  // namespace usct
