#pragma once

#include <Eigen/Geometry>
#include <cstddef>

#include "similarity/packed_ct.h"
#include "similarity/ultrasound_patches.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/similarity/lc2_options.h"
#include "us_ct_registration/similarity/similarity.h"

/// The inner loops of the similarities of UltrasoundPatches and PackedCt: one pass over the
/// samples, no intermediate volume. The scalar versions are the reference; the vector versions,
/// chosen for the machine at run time (AVX-512, AVX2, SSE, NEON), are held to them by tests.
namespace usct {

constexpr std::size_t kLanes = UltrasoundPatches::kLanes;

/// `T_index_us` maps the US frame (mm) to continuous indices of the CT's grid.
struct PatchKernelInput {
  const PackedCt& ct;
  const UltrasoundPatches& us;
  Eigen::Affine3d T_index_us;
  AcquisitionErrors errors;
  GradientChannel channel;
};

/// Number of rows of a block that need no bounds checks, since all their samples lie in the CT. The
/// test is on the block's bounding box: all full rows, or none.
inline std::size_t rows_inside(const PatchKernelInput& in, const UltrasoundPatches::Block& block) {
  if (in.errors.any()) return 0;
  constexpr double kRounding = 0.01;  // error of indices in single precision
  const Eigen::Vector3d centre = in.T_index_us * block.box.center().cast<double>();
  const Eigen::Vector3d half =
      in.T_index_us.linear().cwiseAbs() * block.box.sizes().cast<double>() / 2.0;
  const Eigen::Vector3d last = (in.ct.grid().size.array() - 1).cast<double>();
  const bool inside = ((centre - half).array() > kRounding).all() &&
                      ((centre + half).array() < last.array() - kRounding).all();
  return inside ? block.full_rows : 0;
}

/// Mean of all samples of the ultrasound.
inline double mean_of(const UltrasoundPatches& us) {
  double sum = 0.0;
  for (const UltrasoundPatches::Patch& patch : us.patches)
    sum += static_cast<double>(patch.count) * patch.mean;
  return sum / static_cast<double>(us.count);
}

/// Makes a kernel's input. Throws InputError if the patches lack beams that errors or channel need.
inline PatchKernelInput kernel_input(const UltrasoundPatches& us, const PackedCt& ct,
                                     const SimilarityPose& pose, GradientChannel channel) {
  if (!us.has_beams() && (pose.errors.any() || channel == GradientChannel::kAlongBeam))
    throw InputError("ultrasound patches",
                     "have no beams, must have them for acquisition errors "
                     "and for gradients along beams");
  return {ct, us, ct.grid().T_index_physical() * pose.T_ct_us, pose.errors, channel};
}

/// Sums over each strand of a block; m is the CT value minus the background in steps of a byte
/// (PackedCt::step_hu), g the gradient in such steps per mm, u the ultrasound minus the patch's
/// mean. Outside the CT m = g = 0.
struct StrandSums {
  float inside[kLanes];  // samples in the CT
  float m[kLanes], g[kLanes];
  float mm[kLanes], gg[kLanes], mg[kLanes];
  float um[kLanes], ug[kLanes];
};

/// Sums of the strands of the blocks [first, last); one entry each.
void sum_strands_scalar(const PatchKernelInput& input, std::size_t first, std::size_t last,
                        StrandSums* sums);
void sum_strands_simd(const PatchKernelInput& input, std::size_t first, std::size_t last,
                      StrandSums* sums);

/// CT values of the samples of a block (kLanes * rows), in steps of a byte; samples outside the CT
/// and padding get the background. Returns how many lie inside.
std::size_t sample_block_scalar(const PatchKernelInput& input, std::size_t block, float* values);
std::size_t sample_block_simd(const PatchKernelInput& input, std::size_t block, float* values);

/// Added to the variances of m and g, as a share of their mean squares, since the rounding of the
/// sums can make a variance of this size out of 0.
constexpr double kLc2Floor = 1e-6;

/// The ridge of explained_share.
struct Lc2Ridge {
  double intensity = 0.0;  // steps of a byte
  double gradient = 0.0;   // steps of a byte per mm
  bool positive_gradient = false;
};

/// Sums over a patch (or all samples) of u, m and g as in StrandSums; `count` includes samples
/// outside the CT, and the sum of u is 0.
struct PatchMoments {
  double count = 0.0;
  double uu = 0.0;
  double m = 0.0, g = 0.0;
  double mm = 0.0, gg = 0.0, mg = 0.0;
  double um = 0.0, ug = 0.0;
};

/// The weights of the fit that explained_share describes, with the moments about the means; those
/// of its normal equations are damped by the ridge.
struct Lc2Fit {
  double mm = 0.0, gg = 0.0, mg = 0.0;
  double damped_mm = 0.0, damped_gg = 0.0;
  double a = 0.0, b = 0.0;
  bool both = false;  // whether b was fitted, or is 0
};
Lc2Fit lc2_fit(const PatchMoments& sums, const Lc2Ridge& ridge);

/// Share of the variance of u that a * m + b * g + c explains, in [0, 1]; the weights minimise the
/// squared residual plus count * ((intensity * a)^2 + (gradient * b)^2), with b >= 0 if
/// `positive_gradient`. 0 if u is constant, or both m and g are.
double explained_share(const PatchMoments& sums, const Lc2Ridge& ridge);

/// explained_share for one block of single-strand patches; count and uu are per lane (0 in lanes
/// without a patch).
void explained_shares_scalar(const StrandSums& sums, const double* count, const double* uu,
                             const Lc2Ridge& ridge, double* shares);
void explained_shares_simd(const StrandSums& sums, const double* count, const double* uu,
                           const Lc2Ridge& ridge, double* shares);

}  // namespace usct
