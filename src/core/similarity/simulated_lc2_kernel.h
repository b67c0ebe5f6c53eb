#pragma once

#include <cstdint>

/// The fused pass of SimulatedLc2: input and output of the SIMD code, in plain floats.
namespace usct::simulated_lc2 {

/// Neighbouring lines of a frame that are simulated side by side; a multiple of any vector's lanes.
constexpr int kLinesPerBlock = 16;

/// A voxel of the CT in 64 bits; a sample loads two neighbours along x at once.
struct PackedVoxel {
  std::int16_t hu;  // within the window
  /// Voxel ahead minus voxel behind along each index axis, both kept within the CT. Interpolating
  /// these gives the difference of the interpolated values, up to the border.
  std::int16_t difference[3];
};
static_assert(sizeof(PackedVoxel) == 8);

/// Data that do not depend on the pose. Equation numbers are those of simulation.h.
struct Scene {
  int size[3];
  /// The CT and one voxel more, since two are loaded at once.
  const PackedVoxel* voxels;
  /// The recorded CT, of which every hu_step-th value is one of a voxel. With a window the step is
  /// 1, and there is one value more, since gathers read two at once; without, these are those of
  /// `voxels`, which are in the cache anyway.
  const std::int16_t* hu;
  int hu_step;
  float difference_unit;  // HU per unit of PackedVoxel::difference
  float voxels_per_mm[3];

  bool nearest;
  bool windowed;
  bool by_threshold;
  bool on_intensity;  // LogCompression::kIntensity
  bool signed_reflection;
  bool use_background;
  float gas_hu, bone_hu, total_hu_per_mm;
  float hu_shift, mu_floor, outside_mu;
  float half_length_mm;  // l / 2: eqs 4.3 and 4.4 divide it by mu
  float log_a, reflection_scale;
  /// p = slope (mu - outside_mu) + outside_p, kept within [least_p, most_p]. Sums take p -
  /// p_origin.
  float slope, outside_p, least_p, most_p, p_origin;
};

/// Beams side by side. `first` and `step` are indices of the CT at the first sample and from one
/// sample to the next.
struct Block {
  float first[3][kLinesPerBlock];
  float step[3][kLinesPerBlock];
  float per_sample_mm;  // 1 / spacing
  /// Power of t (eq 4.4) that one sample transmits; 0: t itself.
  float transmission_power;
  /// Samples for which what reflects totally echoes; 0: it is occluded itself.
  int echo_samples;
  /// samples x kLinesPerBlock; NaN where a sample does not count.
  const float* ultrasound;
  int samples;
  /// No beam has a sample that counts before this one.
  int first_used;
};

/// Sums over samples that count: of the ultrasound U, mapped CT p and reflection r where the sound
/// arrives, and of U where it does not.
struct Sums {
  std::int64_t in_body = 0, insonified = 0, occluded = 0;
  double u = 0.0, p = 0.0, r = 0.0;
  double uu = 0.0, up = 0.0, ur = 0.0, pp = 0.0, pr = 0.0, rr = 0.0;
  double u_occluded = 0.0, uu_occluded = 0.0;

  Sums& operator+=(const Sums& other);
};

/// Adds up eqs 4.3-4.8 along the beams of a block, with the widest vectors of this processor.
void add_block(const Scene& scene, const Block& block, Sums& sums);

}  // namespace usct::simulated_lc2
