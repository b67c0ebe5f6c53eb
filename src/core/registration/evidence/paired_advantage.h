#pragma once

#include <vector>

#include "registration/evidence/clusters.h"

namespace usct::registration {

/// How surely one pose explains the ultrasound better than another one, part by part: Student's t
/// of the differences of the parts' contributions, summed over clusters, since the contributions of
/// neighbouring parts are not independent. NaN for fewer than two clusters.
double paired_advantage(const std::vector<double>& parts, const std::vector<double>& other,
                        const Clusters& clusters);

}  // namespace usct::registration
