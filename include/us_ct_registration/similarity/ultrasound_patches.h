#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "us_ct_registration/similarity/large_pages.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// Which samples count: all, or every other one of each line, line and frame (a face-centred
/// lattice), which takes half the time and averages less noise.
enum class SampleSubset { kAll, kHalf };

/// How ultrasound is cut into patches, each of which is explained by weights of its own.
struct PatchOptions {
  /// Edges, mm, along the beams, across lines and across frames; judged in the middle of the
  /// depths, since beams diverge. Infinite: one patch along that axis.
  double depth_mm = 4.0;
  double lateral_mm = 4.0;
  double elevation_mm = 4.0;
  /// A patch counts if at least this share of its samples is known; (0, 1].
  double least_share = 0.5;
  SampleSubset samples = SampleSubset::kAll;

  /// One patch: a global similarity.
  static PatchOptions whole() {
    const double infinite = std::numeric_limits<double>::infinity();
    return {infinite, infinite, infinite, 1e-6, SampleSubset::kAll};
  }
  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "patch options") const;

  friend bool operator==(const PatchOptions& a, const PatchOptions& b) {
    return a.depth_mm == b.depth_mm && a.lateral_mm == b.lateral_mm &&
           a.elevation_mm == b.elevation_mm && a.least_share == b.least_share &&
           a.samples == b.samples;
  }
};

/// What is kept of each sample besides its value. Only GradientChannel::kAlongBeam and
/// AcquisitionErrors other than zero need the beams, which take three quarters of the memory.
enum class PatchContents { kPositions, kWithBeams };

/// The samples of ultrasound that count, patch by patch, laid out for vector instructions: each
/// lane works through a *strand*, up to kLongestStrand samples of one patch, and kLanes strands lie
/// side by side in a *block*. So small patches need no sums across lanes, and no filling up but at
/// the ends of strands that are shorter than the longest of their block.
struct UltrasoundPatches {
  static constexpr std::size_t kLanes = 16;
  static constexpr std::size_t kLongestStrand = 128;
  /// Position of what fills up, whose value is 0.
  static constexpr float kNowhere = 1e30F;

  struct Patch {
    std::size_t count = 0;    // samples that count
    double mean = 0.0;        // of the ultrasound in it
    double square_sum = 0.0;  // of the ultrasound minus its mean
    double depth_mm = 0.0;    // of its samples, on average
    std::size_t first_strand = 0;
    std::size_t strands() const { return (count + kLongestStrand - 1) / kLongestStrand; }
  };
  /// Sample r of strand `kLanes * b + lane` is at `blocks[b].begin + kLanes * r + lane`.
  struct Block {
    std::size_t begin = 0;
    std::size_t rows = 0;
    /// Those at the beginning that nothing fills up.
    std::size_t full_rows = 0;
    /// Around its samples, US mm.
    Eigen::AlignedBox3f box;
  };

  /// Per sample: position in the US frame, mm, and ultrasound minus the mean of its patch.
  LargeVector<float> x_mm, y_mm, z_mm, value;
  /// Per sample: unit direction of its beam in the US frame, and its depth, mm. These and what
  /// follows are empty without beams (PatchContents).
  LargeVector<float> direction_x, direction_y, direction_z, depth_mm;
  /// Per sample: how it moves per unit of AcquisitionErrors::sweep, mm, to first order.
  LargeVector<float> sweep_x, sweep_y, sweep_z;
  std::vector<Block> blocks;
  /// Those with more samples first, in the order of the ultrasound where they have as many. Those
  /// of one strand begin with the lanes of `blocks[first_single_block]`, one lane each.
  std::vector<Patch> patches;
  std::size_t first_single_block = 0;
  std::size_t first_single_patch = 0;
  /// Samples that count, in all patches.
  std::size_t count = 0;

  bool has_beams() const { return !depth_mm.empty(); }
};

/// Cuts what is known of the ultrasound into patches; those whose ultrasound is constant are left
/// out. Throws InputError for invalid ultrasound or options.
UltrasoundPatches cut_into_patches(const BeamUltrasound& ultrasound, const PatchOptions& options,
                                   PatchContents contents = PatchContents::kWithBeams);

}  // namespace usct
