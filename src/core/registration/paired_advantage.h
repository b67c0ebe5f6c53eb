#pragma once

#include <Eigen/Core>
#include <vector>

namespace usct::registration {

/// How surely one pose explains the ultrasound better than another one, part by part: Student's t
/// of the differences of the parts' contributions, summed over cubes of `cluster_mm`, since the
/// contributions of neighbouring parts are not independent. `centres_us_mm` are the positions of
/// the parts. NaN for fewer than two clusters.
double paired_advantage(const std::vector<double>& parts, const std::vector<double>& other,
                        const std::vector<Eigen::Vector3d>& centres_us_mm, double cluster_mm);

}  // namespace usct::registration
