#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "large_pages.h"
#include "us_ct_registration/similarity/patch_options.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// Data that are kept of each sample besides its value. Only GradientChannel::kAlongBeam and
/// AcquisitionErrors other than zero need the beams, which take three quarters of the memory.
enum class PatchContents { kPositions, kWithBeams };

/// The samples of ultrasound that count, patch by patch, laid out for vector instructions: each
/// lane works through a *strand*, up to kLongestStrand samples of one patch, and kLanes strands lie
/// side by side in a *block*. Small patches thus need no sums across lanes, and padding only behind
/// strands that are shorter than the longest of their block.
struct UltrasoundPatches {
  static constexpr std::size_t kLanes = 16;
  static constexpr std::size_t kLongestStrand = 128;
  /// Position of padding, whose value is 0.
  static constexpr float kNowhere = 1e30F;

  struct Patch {
    std::size_t count = 0;                                   // number of samples that count
    double mean = 0.0;                                       // mean of its ultrasound
    double square_sum = 0.0;                                 // squared deviations from the mean
    double depth_mm = 0.0;                                   // mean depth of its samples
    Eigen::Vector3d centre_us_mm = Eigen::Vector3d::Zero();  // middle of the patch
    std::size_t first_strand = 0;
    std::size_t strands() const { return (count + kLongestStrand - 1) / kLongestStrand; }
    /// Number of samples of one of its strands, of which the first is 0.
    std::size_t rows_of(std::size_t strand) const {
      return (strand + 1) * count / strands() - strand * count / strands();
    }
  };
  /// Sample r of strand `kLanes * b + lane` is at `blocks[b].begin + kLanes * r + lane`.
  struct Block {
    std::size_t begin = 0;
    std::size_t rows = 0;
    /// Number of leading rows without padding.
    std::size_t full_rows = 0;
    /// Bounding box of its samples, US frame, mm.
    Eigen::AlignedBox3f box;
  };

  /// Per sample: position in the US frame, mm, and ultrasound minus the mean of its patch.
  LargeVector<float> x_mm, y_mm, z_mm, value;
  /// Per sample: unit direction of its beam in the US frame, and its depth, mm. These and the
  /// following arrays are empty without beams (PatchContents).
  LargeVector<float> direction_x, direction_y, direction_z, depth_mm;
  /// Per sample: how it moves per unit of AcquisitionErrors::sweep, mm, to first order.
  LargeVector<float> sweep_x, sweep_y, sweep_z;
  /// Per sample: 1 if its frame lies after the middle of the sweep, -1 before it.
  LargeVector<float> sweep_side;
  /// Per patch: how its samples move per unit of AcquisitionErrors::depth, ::sweep and ::unevenness
  /// on average, mm.
  std::vector<Eigen::Matrix3d> by_errors_mm;
  std::vector<Block> blocks;
  /// Patches with more samples come first, those of equal size in the order of the ultrasound.
  /// Single-strand patches begin with the lanes of `blocks[first_single_block]`, one lane each.
  std::vector<Patch> patches;
  std::size_t first_single_block = 0;
  std::size_t first_single_patch = 0;
  /// Number of samples that count, in all patches.
  std::size_t count = 0;

  bool has_beams() const { return !depth_mm.empty(); }
};

/// Cuts the known ultrasound into patches; those whose ultrasound is constant are left out. Throws
/// InputError for invalid ultrasound or options.
UltrasoundPatches cut_into_patches(const BeamUltrasound& ultrasound, const PatchOptions& options,
                                   PatchContents contents = PatchContents::kWithBeams);

}  // namespace usct
