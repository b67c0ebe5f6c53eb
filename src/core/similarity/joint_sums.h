#pragma once

#include <vector>

#include "similarity/patch_kernel.h"

/// The inner loop of the joint correlation ratio: one pass over the samples, no intermediate
/// volume. The scalar version is the reference; the vector version is held to it by tests.
namespace usct {

/// Sums of ultrasound over a grid of knots in CT value (rows) and gradient (columns). A sample is
/// shared by the four knots around it, bilinearly, so that the sums are continuous in the pose.
struct JointSums {
  std::vector<double> ultrasound;  // [row * columns + column]
  std::vector<double> count;
  double inside = 0.0;  // samples in the CT
};

/// Positions of the knots: evenly along the CT value over the window of the packed CT; along the
/// gradient g evenly in t = g / (g + scale) from 0 to 1, since steep gradients are rare and have
/// similar echoes.
struct JointSumsInput {
  PatchKernelInput samples;  // its channel is not used
  /// Ultrasound per place of UltrasoundPatches; NaN at padding.
  const float* ultrasound;
  int rows;
  int columns;
  double gradient_scale_hu_per_mm;
};

JointSums joint_sums_scalar(const JointSumsInput& input);
JointSums joint_sums_simd(const JointSumsInput& input);

}  // namespace usct
