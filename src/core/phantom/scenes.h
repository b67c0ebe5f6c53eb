#pragma once

#include <cstdint>
#include <vector>

#include "us_ct_registration/phantom/anatomy.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom {

/// Kidney in agar (thesis 3.1).
Scene make_agar_scene(std::uint64_t seed, const AnatomyOptions& options);
/// Kidney in a torso, seen from the flank.
Scene make_patient_scene(std::uint64_t seed, const AnatomyOptions& options);
/// A real CT as anatomy.
Scene make_ct_scene(std::uint64_t seed, const CtVolume& ct, const LabelVolume& labels,
                    const FromCtOptions& from_ct, const AnatomyOptions& options);

/// `count` directions spread evenly over the sphere (a Fibonacci lattice).
std::vector<Eigen::Vector3d> even_directions(int count);

/// A rotation whose y axis is `forward` and whose x axis is as close as can be to `lateral`.
Eigen::Matrix3d looking(const Eigen::Vector3d& forward, const Eigen::Vector3d& lateral);

/// The depth below the array that shows all of the kidney and 28 mm behind it, in steps of 5 mm.
/// `scene` must have its probe and the kidney's surface.
double depth_that_shows_kidney_mm(const Scene& scene);

/// Number of targets on the kidney's surface.
constexpr int kTargetCount = 400;

}  // namespace usct::phantom
