#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "us_ct_registration/similarity/packed_ct.h"
#include "us_ct_registration/similarity/patch_similarity.h"
#include "us_ct_registration/similarity/ultrasound_patches.h"

/// The inner loop of all similarities that are made of moments: one pass over the samples, no
/// intermediate volume. The scalar version is the reference; the vector version, chosen for the
/// machine at run time (AVX-512, AVX2, SSE, NEON), is held to it by tests.
namespace usct {

/// Sums over the samples of a patch; m is the CT value minus the background in steps of a byte
/// (PackedCt::step_hu), g the gradient in such steps per mm, u the ultrasound minus the patch's
/// mean. Outside the CT m = g = 0.
struct PatchSums {
  float inside = 0.0F;  // samples in the CT
  float m = 0.0F;
  float g = 0.0F;
  float mm = 0.0F;
  float gg = 0.0F;
  float mg = 0.0F;
  float um = 0.0F;
  float ug = 0.0F;
};

/// `T_index_us` maps the US frame (mm) to continuous indices of the CT's grid.
struct PatchSumsInput {
  const PackedCt& ct;
  const UltrasoundPatches& us;
  /// Positions of the samples, mm: those of `us`, or moved by acquisition errors.
  const float* x_mm;
  const float* y_mm;
  const float* z_mm;
  Eigen::Affine3d T_index_us;
  GradientChannel channel;
};

/// One entry per patch.
void sum_patches_scalar(const PatchSumsInput& input, PatchSums* sums);
void sum_patches_simd(const PatchSumsInput& input, PatchSums* sums);

}  // namespace usct
