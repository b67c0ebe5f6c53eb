#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "us_ct_registration/similarity/packed_ct.h"
#include "us_ct_registration/similarity/ultrasound_patches.h"

/// The inner loop of the joint correlation ratio: one pass over the samples, no intermediate
/// volume. The scalar version is the reference; the vector version is held to it by tests.
namespace usct {

/// Sums of ultrasound over a grid of knots in CT value (rows) and gradient (columns). A sample is
/// shared by the four knots around it, bilinearly, so that the sums are continuous in the pose.
struct JointSums {
  int rows = 0;
  int columns = 0;
  std::vector<double> ultrasound;  // [row * columns + column]
  std::vector<double> count;
  double inside = 0.0;  // samples in the CT
};

/// Where the knots lie: CT value evenly over the window of the packed CT; gradient g at t = g / (g
/// + scale), t evenly from 0 to 1, since steep gradients are rare and echo alike.
struct JointSumsInput {
  const PackedCt& ct;
  const UltrasoundPatches& us;
  const float* x_mm;
  const float* y_mm;
  const float* z_mm;
  /// US frame (mm) to continuous indices of the CT's grid.
  Eigen::Affine3d T_index_us;
  int rows;
  int columns;
  double gradient_scale_hu_per_mm;
};

JointSums joint_sums_scalar(const JointSumsInput& input);
JointSums joint_sums_simd(const JointSumsInput& input);

}  // namespace usct
